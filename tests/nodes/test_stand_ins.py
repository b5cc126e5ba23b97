"""A real session waits until an operator has confirmed in words what stands in for a device or a screen."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from stepped_session import SteppedSession

from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Block
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import sockets
from netboard.nodes.ports.peer import ProbedPeer
from netboard.nodes.server.session import HOUSEKEEPING_TICKS
from netboard.nodes.server.stand_ins import AWAITING_WORDS, KNOWN, Confirmations, stand_ins
from netboard.recording.format.rig import rig_of
from netboard.task.trials.state_machine import Phase

REAL = {"kind": "haptic"}
LEFT, RIGHT = "left device simulated", "right device mouse pointer"


def connect(session: SteppedSession, kind: str) -> None:
    """Connect an agent with a device of this kind at the left, which stays although it sends no sample."""
    motion = session.state.ports.motion
    motion.expire = lambda now_ns: None  # type: ignore[method-assign]
    details = {"device": "x", "kind": kind}
    motion.agents["left"].hello = Hello("agent", "left", PROTOCOL_VERSION, "lab:1", "0", details)


@pytest.fixture
def real(tmp_path: Path, context: sockets.Context) -> Iterator[SteppedSession]:
    """A session with consent and a simulated device on the left."""
    session = SteppedSession(tmp_path, context, pilot=False)
    connect(session, "simulated")
    assert session.do("open", '{"consent": true}')[0]
    yield session
    session.state.ports.motion.agents["left"].hello = None
    session.close()


def begin(session: SteppedSession) -> tuple[bool, str]:
    session.tick(HOUSEKEEPING_TICKS)
    session.do("arm")
    return session.do("start")


def test_real_session_with_a_simulated_device_waits_for_words(real: SteppedSession) -> None:
    accepted, reason = begin(real)
    assert not accepted
    assert reason == f"cannot start: waiting for {AWAITING_WORDS}: {LEFT}"
    assert not real.do("confirm", "yes, go on")[0]
    assert not real.do("confirm", "")[0]
    assert real.do("confirm", f"{LEFT.upper()}: its device is being repaired") == (True, f"confirmed: {LEFT}")
    assert begin(real)[0]


def test_confirmation_is_recorded_in_every_block(real: SteppedSession) -> None:
    real.do("confirm", f"the {LEFT}")
    real.tick(HOUSEKEEPING_TICKS)
    real.session._blocks._begin_block()
    real.tick(HOUSEKEEPING_TICKS)
    said = [event.details for event in real.events() if event.name == "stand_in_confirmed"]
    assert said == [{"what": LEFT, "words": f"the {LEFT}", "by": "console"}] * 2


def test_part_of_another_logger_has_the_devices_and_the_confirmations(real: SteppedSession) -> None:
    real.do("confirm", f"the {LEFT}")
    assert begin(real)[0]
    real.tick(HOUSEKEEPING_TICKS)
    before = len(real.events())
    real.state.ports.log.news.append(("logger_joined", {"name": "lab:7"}))
    real.tick(2 * HOUSEKEEPING_TICKS)
    part = [event for event in real.events()[before:] if event.name != "level"]
    assert [event.name for event in part] == ["logger_joined", "agent_present", "stand_in_confirmed"]
    rig = rig_of(real.state.block.config, {}, part, ())
    assert rig.stand_ins == {LEFT: f'confirmed by console: "the {LEFT}"'}
    assert rig.simulated == ("left",)


def test_another_stand_in_needs_words_of_its_own(real: SteppedSession) -> None:
    real.do("confirm", LEFT)
    assert begin(real)[0]
    real.do("pause")
    real.until(Phase.PAUSED)
    connect(real, "pointer")
    real.tick(HOUSEKEEPING_TICKS)
    assert real.do("resume") == (False, f"cannot resume: waiting for {AWAITING_WORDS}: left device mouse pointer")


def test_pilot_needs_no_words(stepped: SteppedSession) -> None:
    connect(stepped, "simulated")
    assert begin(stepped)[0]
    stepped.state.ports.motion.agents["left"].hello = None


def test_words_of_the_command_line_confirm_a_stand_in_that_joins_later(
    tmp_path: Path, context: sockets.Context
) -> None:
    session = SteppedSession(tmp_path, context, pilot=False)
    session.state.confirmations = Confirmations(f"{LEFT}, right device simulated")
    assert session.do("open", '{"consent": true}')[0]
    connect(session, "simulated")
    session.tick(HOUSEKEEPING_TICKS)
    assert begin(session)[0]
    (said,) = [event.details for event in session.events() if event.name == "stand_in_confirmed"]
    assert said["by"] == "the command line of the server"
    session.state.ports.motion.agents["left"].hello = None
    session.close()


def test_display_that_nobody_sees_is_a_stand_in(real: SteppedSession) -> None:
    control = real.state.ports.control
    real.do("confirm", LEFT)
    for name, platform in ((b"first", "xcb"), (b"newest", "offscreen")):
        hello = Hello("display", "right", PROTOCOL_VERSION, "lab:2", "0", {"platform": platform})
        control._peers[name] = ProbedPeer(hello, now_ns())
    real.tick(HOUSEKEEPING_TICKS)
    assert control.platforms == {"right": "offscreen"}
    assert real.state.missing == (f"{AWAITING_WORDS}: right display off screen",)
    real.session._blocks._begin_block()
    shown = [event.details["platform"] for event in real.events() if event.name == "display_present"]
    assert shown[-2:] == ["xcb", "offscreen"]
    control._peers.clear()


def test_stand_ins_of_a_block_are_found_by_their_kind() -> None:
    config = Config()
    held = {"left": {"kind": "simulated"}, "right": {"kind": "pointer"}}
    assert stand_ins(config, held, {"left": "xcb", "right": "offscreen:x"}) == (LEFT, RIGHT, "right display off screen")  # type: ignore[arg-type]
    assert stand_ins(config, {"left": REAL, "right": REAL}, {"left": "wayland"}) == ()
    spacemouse = {"left": {"kind": "input"}}
    assert stand_ins(config, spacemouse, {}) == ("left device without force",)  # type: ignore[arg-type]
    assert stand_ins(replace(config, block=Block(force="none")), spacemouse, {}) == ()  # type: ignore[arg-type]


def test_confirmation_that_names_nothing_is_refused() -> None:
    with pytest.raises(ConfigError, match="names nothing that stands in"):
        Confirmations("left device fine")
    assert len(set(KNOWN)) == len(KNOWN)


def test_stand_ins_are_confirmed_one_by_one_or_at_once() -> None:
    made = Confirmations()
    assert made.confirm(LEFT, "console", (LEFT, RIGHT)) == f"confirmed: {LEFT}; not yet: {RIGHT}"
    assert made.unconfirmed((LEFT, RIGHT)) == (RIGHT,)
    made = Confirmations()
    made.confirm(f"{RIGHT} and  {LEFT}", "console", (LEFT, RIGHT))
    assert made.unconfirmed((LEFT, RIGHT)) == ()
