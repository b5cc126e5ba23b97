"""Views for the stations: together, only for subscribers, and only new ones."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from netboard.base.config import SIDES, Config, Side, parse
from netboard.base.tables.rig import VIEW_REPEAT_MS
from netboard.base.tick import TICK
from netboard.network.protocol.codec import decode
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.ports.view_port import ViewPort
from netboard.stage.curtain import Curtain, make_curtain
from netboard.stage.view import View
from netboard.task.trials.state_machine import Phase


class Publisher:
    """A publisher in memory, with or without a subscriber."""

    def __init__(self) -> None:
        self.subscribed = True
        self.sent: list[View] = []
        self.closed = False

    def wanted(self) -> bool:
        return self.subscribed

    def send(self, frame: bytes) -> None:
        view = decode(frame)
        assert isinstance(view, View)
        self.sent.append(view)

    def close(self) -> None:
        self.closed = True


class Rig:
    """A port with publishers in memory, and a board that may move."""

    def __init__(self, port: ViewPort, config: Config) -> None:
        self.port = port
        self.stations = {side: Publisher() for side in SIDES}
        self.partners = {side: Publisher() for side in SIDES}
        port._views = {  # type: ignore[assignment]
            **{channels.VIEW[side]: self.stations[side] for side in SIDES},
            **{channels.PARTNER[side]: self.partners[side] for side in SIDES},
        }
        self.curtain: Curtain = make_curtain(config)
        self.rows = np.zeros(1, TICK)
        self.rows["phase"], self.rows["trial"], self.rows["attempt"] = Phase.RUNNING, 1, 1
        self.rows["left_used_z"], self.rows["right_used_z"] = 0.01, 0.02
        self.tick = 0

    def run(self, ticks: int, *, moving: bool = True, best: float | None = None, rest: float | None = None) -> None:
        for _ in range(ticks):
            self.rows["tick"], self.rows["z"] = self.tick, self.tick * 1e-6 if moving else 0.0
            self.port.show(self.tick + 1, self.curtain, self.rows.view(np.int64), best, rest)
            self.tick += 1

    def sent_ticks(self, side: Side) -> list[int]:
        """Ticks of the views sent to a station."""
        return [view.tick for view in self.stations[side].sent]


@pytest.fixture
def config() -> Config:
    return parse("", "test", (f"network.port={free_port()}", "network.view_rate_hz=100", "block.blocks=2"))


@pytest.fixture
def rig(config: Config) -> Iterator[Rig]:
    with sockets.open_context() as context:
        port = ViewPort(config.network, context, None)
        bound = port._views
        created = Rig(port, config)
        yield created
        for publisher in bound.values():
            publisher.close()


def test_stations_receive_views_at_the_view_rate(rig: Rig) -> None:
    rig.run(1000)
    for side in SIDES:
        assert len(rig.sent_ticks(side)) == pytest.approx(100, abs=1)
        assert set(np.diff(rig.sent_ticks(side))) == {10}
    assert rig.sent_ticks("left") == rig.sent_ticks("right")


def test_views_are_numbered_consecutively_per_station(rig: Rig) -> None:
    rig.run(100)
    rig.stations["left"].subscribed = False
    rig.run(100)
    rig.stations["left"].subscribed = True
    rig.run(100)
    assert [view.seq for view in rig.stations["left"].sent] == list(range(20))
    assert [view.seq for view in rig.stations["right"].sent] == list(range(30))


def test_no_view_is_sent_without_a_subscriber(rig: Rig) -> None:
    rig.stations["right"].subscribed = False
    rig.run(200)
    assert rig.sent_ticks("right") == []
    assert len(rig.sent_ticks("left")) == 20


def test_unchanged_view_is_sent_at_the_keep_alive_rate(rig: Rig) -> None:
    rig.run(1000, moving=False)
    assert set(np.diff(rig.sent_ticks("left"))) == {VIEW_REPEAT_MS}
    rig.rows["trial"] = 2
    rig.run(10, moving=False)
    assert rig.stations["left"].sent[-1].trial == 2


def hands_move(rig: Rig, side: Side, ticks: int) -> None:
    """Move one hand only, beside a board at rest."""
    for _ in range(ticks):
        rig.rows[f"{side}_used_z"] += 1e-5
        rig.run(1, moving=False)


def test_times_of_views_do_not_reveal_whether_the_partner_moves(rig: Rig) -> None:
    """Before a block and in a pause, the board may rest while a hand moves."""
    hands_move(rig, "right", 1000)
    assert set(np.diff(rig.sent_ticks("left"))) == {VIEW_REPEAT_MS}
    assert set(np.diff(rig.sent_ticks("right"))) == {10}


def test_times_of_views_reveal_nothing_to_a_station_without_a_task(rig: Rig) -> None:
    rig.curtain = make_curtain(parse('[block]\nconfiguration = "bimanual"'))
    rig.run(500)
    rig.rows["failures"], rig.rows["attempt"], rig.rows["phase"] = 1, 2, Phase.FAILED
    rig.run(500)
    assert set(np.diff(rig.sent_ticks("right"))) == {VIEW_REPEAT_MS}
    assert set(np.diff(rig.sent_ticks("left"))) == {10}


def test_unchanged_view_is_sent_again_in_a_new_block(rig: Rig, config: Config) -> None:
    rig.run(100, moving=False)
    before = len(rig.sent_ticks("left"))
    rig.port.renew()
    rig.run(10, moving=False)
    assert len(rig.sent_ticks("left")) == before + 1
    assert [view.seq for view in rig.stations["left"].sent] == list(range(before + 1)), "the numbers continue"


def test_batched_ticks_send_one_view(rig: Rig) -> None:
    rig.run(1)
    for side in SIDES:
        rig.stations[side].sent.clear()
    rig.tick = 500
    rig.run(1)
    assert rig.sent_ticks("left") == rig.sent_ticks("right") == [500]
    rig.run(30)
    assert len(rig.sent_ticks("left")) <= 5


def test_station_receives_only_what_its_participant_may_see(rig: Rig) -> None:
    rig.run(10, best=0.75, rest=12.5)
    left, right = rig.stations["left"].sent[0], rig.stations["right"].sent[0]
    assert (left.station, left.left, left.right) == ("left", 0.01, None)
    assert (right.station, right.left, right.right) == ("right", None, 0.02)
    assert (left.best, left.rest, left.block, left.blocks) == (0.75, 12.5, 1, 2)


def test_closing_the_port_closes_both_publishers(rig: Rig) -> None:
    rig.port.close()
    assert all(publisher.closed for publisher in rig.stations.values())


def test_robot_partner_sees_the_board_and_the_display_of_its_side_does_not(config: Config) -> None:
    config = replace(config, block=replace(config.block, right="robot"))
    with sockets.open_context() as context:
        port = ViewPort(config.network, context, None)
        bound = port._views
        rig = Rig(port, config)
        rig.run(40)
        for publisher in bound.values():
            publisher.close()
    seen, shown = rig.partners["right"].sent, rig.stations["right"].sent
    assert not rig.partners["left"].sent
    assert {view.phase for view in shown} == {"away"}
    assert {view.phase for view in seen} == {"running"}
    assert len(seen) > 2
    assert all(view.z == pytest.approx(view.tick * 1e-6) and view.right == 0.02 and view.left is None for view in seen)
