"""The holder that an agent serves in a block: its own device, or that of the block's robot partner."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from made_network import noted_text
from netboard.base.config import Config, parse, resolve
from netboard.base.device_kind import SEATED
from netboard.base.errors import ConfigError
from netboard.devices.simulated.partner import RobotPartner
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.agent.agent import introduction
from netboard.nodes.agent.holders import Holder, Holders, holder_of
from netboard.nodes.agent.stylus_source import PartnerSource
from netboard.participants.robots.network import sha256_of

TIMEOUT = 600.0
"""Timeout, far above the usual time [s]."""


@pytest.fixture
def config() -> Config:
    return parse("", "test", (f"network.port={free_port()}",))


@pytest.fixture
def holders(config: Config) -> Iterator[Holders]:
    device = VirtualTouch("right", config)
    device.open()
    with sockets.open_context() as context:
        made = Holders("right", holder_of(config, device, None), context)
        yield made
        made.close()


@pytest.fixture
def chosen(config: Config, holders: Holders) -> Callable[..., Holder | None]:
    """Returns the holder of a block whose right hand is somebody's; None if it cannot be made."""

    def begin(mover: str, **parameters: float | str) -> Holder | None:
        partners = replace(config.partners, right=parameters)
        holders.begin(resolve(replace(config, block=replace(config.block, right=mover), partners=partners)))
        assert holders._coming is not None
        holders._coming.exception(TIMEOUT)
        return holders.chosen()

    return begin


def test_agent_serves_its_own_device_unless_the_block_has_a_robot_partner(
    holders: Holders, chosen: Callable[..., Holder | None]
) -> None:
    own = holders._own
    assert chosen("person") is own
    partner = chosen("robot")
    assert partner is not None
    assert isinstance(partner.device, RobotPartner)
    assert chosen("still") is own
    assert chosen("robot") is partner
    assert chosen("person") is own


def test_agent_introduces_the_partner_that_holds_its_device(chosen: Callable[..., Holder | None]) -> None:
    partner = chosen("robot")
    assert partner is not None
    details = introduction("right", partner.config, partner.device.info, partner.identity).details
    assert (details["device"], details["kind"], details["partner"]) == ("partner", "robot", "robot")
    assert details["policy"] == "simulated participant"
    assert details[SEATED] == "true"
    own = chosen("person")
    assert own is not None
    assert SEATED not in introduction("right", own.config, own.device.info, own.identity).details


def test_partner_has_the_parameters_of_the_block(chosen: Callable[..., Holder | None]) -> None:
    found = [chosen("follower", initiative=share) for share in (0.2, 0.4, 0.2)]
    assert found[0] is found[2] is not found[1]
    texts = [holder.identity["policy_parameters"] for holder in found if holder is not None]
    assert ['"initiative": 0.2' in text for text in texts] == [True, False, True]


def test_block_of_another_partner_does_not_end_the_agent(config: Config, chosen: Callable[..., Holder | None]) -> None:
    """Until the next partner is seated, the one before gets its block, with parameters that it does not have."""
    holder = chosen("follower", initiative=0.2)
    assert holder is not None
    source = holder.source
    assert isinstance(source, PartnerSource)
    partners = replace(config.partners, right={"weights": "learned"})
    source.begin(resolve(replace(config, block=replace(config.block, right="learned"), partners=partners)))
    assert source._coming is not None
    source._coming.exception(TIMEOUT)
    source.step(0, haptics=True)
    assert '"initiative": 0.2' in holder.identity["policy_parameters"]


def test_block_of_the_same_partner_with_a_file_that_is_missing_here_does_not_end_the_agent(
    config: Config, chosen: Callable[..., Holder | None], caplog: pytest.LogCaptureFixture
) -> None:
    holder = chosen("learned", weights="learned")
    assert holder is not None
    source, identity = holder.source, dict(holder.identity)
    assert isinstance(source, PartnerSource)
    assert chosen("learned", weights="none.json") is None
    assert "the robot partner of the block cannot be seated: " in caplog.text
    partners = replace(config.partners, right={"weights": "none.json"})
    source.begin(resolve(replace(config, block=replace(config.block, right="learned"), partners=partners)))
    assert source._coming is not None
    source._coming.exception(TIMEOUT)
    source.step(0, haptics=True)
    assert holder.identity == identity


def test_partner_of_a_file_that_has_changed_is_another_one(
    chosen: Callable[..., Holder | None], tmp_path: Path
) -> None:
    path, found = tmp_path / "weights.json", []
    for text in (noted_text("one"), noted_text("two"), noted_text("one")):
        path.write_text(text)
        holder = chosen("learned", weights=str(path))
        assert holder is not None
        assert sha256_of(text) in holder.identity["policy_parameters"]
        found.append(holder)
    assert found[0] is found[2] is not found[1]


def test_partner_is_not_played_with_a_file_that_has_changed_since(
    config: Config, holders: Holders, chosen: Callable[..., Holder | None], tmp_path: Path
) -> None:
    """The recording would say the SHA-256 of the file before. A robot partner of the block gets another holder."""
    path = tmp_path / "weights.json"
    path.write_text(noted_text("one"))
    holder = chosen("learned", weights=str(path))
    assert holder is not None
    before = dict(holder.identity)
    path.write_text(noted_text("two"))
    source = holder.source
    assert isinstance(source, PartnerSource)
    for mover in ("learned", "person"):
        partners = replace(config.partners, right={"weights": str(path)})
        source.begin(resolve(replace(config, block=replace(config.block, right=mover), partners=partners)))
        assert source._coming is not None
        source._coming.exception(TIMEOUT)
        if mover == "learned":
            source.step(0, haptics=True)
        else:
            with pytest.raises(ConfigError, match="has changed since this agent was started; start it again"):
                source.step(0, haptics=True)
        assert holder.identity == before


def test_unknown_partner_is_reported_and_the_device_stays(
    chosen: Callable[..., Holder | None], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        assert chosen("nobody") is None
    assert "the robot partner of the block cannot be seated: this machine has no robot partner 'nobody'" in caplog.text


def test_lost_device_that_is_back_has_a_new_safety_chain(
    holders: Holders, config: Config, chosen: Callable[..., Holder | None]
) -> None:
    own = holders._own
    again = holder_of(config, own.device, None).safety
    assert holders.renewed(own, again).safety is again
    assert chosen("person") is holders._own
    assert holders._own.safety is again
    partner = chosen("robot")
    assert partner is not None
    assert holders.renewed(partner, again) is chosen("robot")
