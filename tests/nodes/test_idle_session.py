"""Ticks of an idle session are computed together, with the same result as one by one."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.tick import TICK, TICK_NS
from netboard.network.protocol.codec import decode
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.session import DyadSession
from netboard.nodes.server.state import RING_ROWS
from netboard.nodes.server.tick_clock import NO_PEER_TICKS
from netboard.stage.stage import make_stage

DUE = 10**12


@pytest.fixture
def config() -> Config:
    config = Config()
    return replace(config, network=replace(config.network, port=free_port(), log_spill_mb=0.0))


@pytest.fixture
def session(config: Config) -> Iterator[DyadSession]:
    with sockets.open_context() as context:
        session = DyadSession(BlockSequence([config]), Attempts(), context, None, autostart=True)
        session.begin(DUE, {})
        yield session
        session.records.end()
        session.records.close()
        session._log.close()


def records(session: DyadSession) -> list[TickRecord | EventRecord]:
    ring = session._log.ring
    return [decode(frame) for frame in ring.batch(0, ring.next, 2**30).records]


@pytest.mark.parametrize("rounds", [(1, 1, 1), (NO_PEER_TICKS, 1, 7), (RING_ROWS - 1, 50), (RING_ROWS,)])
def test_batched_idle_ticks_equal_single_ticks(session: DyadSession, config: Config, rounds: tuple[int, ...]) -> None:
    for count in rounds:
        session._idle_ticks(session._clock.due_ns + (count - 1) * TICK_NS)
    rows = np.zeros(sum(rounds), TICK)
    stage = make_stage(config)
    state = stage.initial()
    for number in range(len(rows)):
        row = rows[number : number + 1]
        row["tick"], row["time_ns"] = number, DUE + number * TICK_NS
        for side in ("left", "right"):
            row[f"{side}_seq"], row[f"{side}_rendered"] = -1, np.nan
        stage.advance(state, rows, number)
    written = [record.row for record in records(session) if isinstance(record, TickRecord)]
    assert b"".join(written) == rows.tobytes()
    assert session._clock.due_ns == DUE + len(rows) * TICK_NS


def test_session_is_alone_only_without_any_peer(session: DyadSession) -> None:
    state = session._state
    assert state.alone
    state.ports.control._peers[b"console"] = None  # type: ignore[assignment]
    assert not state.alone
    state.ports.control._peers.clear()


@pytest.mark.parametrize("required", [True, False])
def test_records_are_kept_from_the_start_of_a_trial_that_needs_a_logger(session: DyadSession, required: bool) -> None:
    block = session._state.block
    network = replace(block.config.network, require_logger=required)
    session._state.block = replace(block, config=replace(block.config, network=network))
    session.records.start()
    assert session._log.store.needed is required
