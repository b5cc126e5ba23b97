"""Answers to operators' questions: the session's status, the outcomes of its attempts, and the recent ticks.

Nothing here changes the session. Answers are made between two ticks, so a frequent question must be cheap to answer.
"""

from collections.abc import Iterable, Iterator, Mapping
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, Side
from netboard.base.device_kind import HIDDEN, HIDDEN_TEXT, MOVED_BY_SERVER, held_by
from netboard.base.tables.experiment import MAX_TRIALS, STILL
from netboard.network.protocol.control import (
    DeviceStatus,
    DisplayStatus,
    LoopStatus,
    Outcomes,
    StandInStatus,
    StationStatus,
    Status,
    Trace,
    TracePoint,
)
from netboard.nodes.ports.emergency import AWAITING_RELEASE
from netboard.nodes.server.state import SessionState
from netboard.stage.blinding import for_operator
from netboard.stage.curtain import PHASE_NAMES
from netboard.task.trials.state_machine import Phase

TRACE_EVERY = 5
"""Ticks between two points of a trace [1]."""

SAFEGUARD_TICKS = 100
"""Window over which operators see the interventions of the safety chain [ticks]."""

TRACE_MARGIN_TICKS = 10
"""Oldest rows of the ring that a trace leaves out, because they are about to be overwritten [1]."""

MOST_AHEAD = 3
"""Most blocks ahead in a status [1]."""

_TRACED = ("left_used_z", "right_used_z", "z", "theta", "p", "left_rendered", "right_rendered")


class SessionAnswers:
    """Answers operators' questions about a session."""

    def __init__(self, state: SessionState) -> None:
        self._state = state

    def status(self) -> Status:
        """Return the status of the session."""
        session, ports = self._state, self._state.ports
        stage, config, latency = session.stage[0], session.block.config, session.block.latency
        now = now_ns()
        agents = tuple(f"agent.{side}" for side in SIDES if ports.motion.agents[side].hello is not None)
        loggers = ("logger",) * ports.log.loggers + ("listener",) * len(ports.log.subscribers)
        asked, said = session.questionnaires and f"ask now: {session.questionnaires}", session.supervisor.notice
        found = session.shown_stand_ins()
        unconfirmed = session.confirmations.unconfirmed(found)
        troubles = (
            session.forms.notice,
            session.attempts.warning,
            session.attempts.trouble,
            ports.log.notice,
            latency.notice,
            session.triggers.notice,
            session.loss,
        )
        return Status(
            session=session.session,
            tick=session.number,
            phase=PHASE_NAMES[int(stage["phase"])],
            trial=int(stage["trial"]),
            trials=config.block.trials + int(stage["extra"]),
            successes=int(stage["successes"]),
            failures=int(stage["failures"]),
            completions=tuple(session.attempts.completions[-MAX_TRIALS:]),  # repeats may add to them
            late_ticks=session.clock.late_ticks,
            waiting_for=self._awaited(),
            peers=(*agents, *loggers, *ports.control.peers),
            notice="; ".join(filter(None, (asked, said, *(one for one in troubles if one not in said)))),
            links=(*ports.motion.links(now), *ports.log.links(now), *ports.control.links(now)),
            loops=self._loops(),
            **plan_of(for_operator(config)),
            opened=session.operators.opened,
            armed=session.operators.armed,
            commander=session.operators.name if ports.control.is_present(session.operators.commander) else "",
            rest=session.rest(now) or 0.0,
            pending=session.operators.pending,
            outcomes=len(session.attempts.finished),
            recordings=ports.log.recordings(now),
            stations=tuple(self._station(side, now) for side in SIDES),
            refused=ports.refused(session.authenticator),
            lost=session.attempts.lost.trials,
            repeats=session.attempts.pending_repeats(int(stage["trial"])),
            devices=tuple(self._devices()),
            displays=tuple(DisplayStatus(*shown) for shown in ports.control.platforms.items()),
            stand_ins=tuple(StandInStatus(words, words not in unconfirmed) for words in found),
            ahead=tuple(map(words_of, session.sequence.ahead(MOST_AHEAD))),
        )

    def _awaited(self) -> tuple[str, ...]:
        """Return what the block waits for; a block that is over waits for no peer."""
        missing = self._state.missing
        if self._state.phase == Phase.FINISHED:
            return tuple(one for one in missing if one == AWAITING_RELEASE)
        return missing

    def _devices(self) -> Iterator[DeviceStatus]:
        """Yield what each hand holds that a device or the server moves; not what it is in a blinded block."""
        session = self._state
        for side in SIDES:
            block, agent = session.block.config.block, session.ports.motion.agents[side]
            mover = getattr(block, side)
            if block.blinded:
                if agent.hello is not None:
                    yield DeviceStatus(side, HIDDEN, "", "", HIDDEN_TEXT)
            elif mover == STILL:
                yield moved_by_server(side, mover)
            elif agent.hello is not None:
                yield device_status(side, agent.hello.details)

    def _loops(self) -> tuple[LoopStatus, ...]:
        """Return the current sample-to-force latency and its limit [s] of each connected agent.

        A blinded block has none, because they depend on the device.
        """
        if self._state.block.config.block.blinded:
            return ()
        latency, agents_of = self._state.block.latency, self._state.ports.motion.agents
        late = dict(zip(SIDES, latency.latencies, strict=True))
        limit = latency.limit_ns * 1e-9
        present = (side for side in SIDES if agents_of[side].hello is not None)
        return tuple(LoopStatus(f"agent.{side}", late[side], limit) for side in present)

    def _station(self, side: Side, now: int) -> StationStatus:
        """Return the state of a station."""
        session = self._state
        agent = session.ports.motion.agents[side]
        if agent.hello is None:
            return StationStatus(side, nan, 0, 0.0, *session.attempts.counts(side))
        newest = np.arange(max(session.number - SAFEGUARD_TICKS, 0), session.number) % len(session.rows)
        bits = int(np.bitwise_or.reduce(session.rows[f"{side}_safeguards"][newest], initial=0))
        rendered = float(session.rows[f"{side}_rendered"][(session.number - 1) % len(session.rows)])
        return StationStatus(side, agent.silent_ns(now) * 1e-9, bits, rendered, *session.attempts.counts(side))

    def outcomes(self, first: int) -> Outcomes:
        """Return the outcomes of the attempts, starting with attempt number `first`."""
        return self._state.attempts.outcomes(first)

    def trace(self, after: int) -> Trace:
        """Return the ticks after this one that are still in the ring."""
        oldest = max(after + 1, self._state.number - len(self._state.rows) + TRACE_MARGIN_TICKS, 0)
        numbers = range(-(-oldest // TRACE_EVERY) * TRACE_EVERY, self._state.number, TRACE_EVERY)
        rows = self._state.rows[np.array(numbers, np.int64) % len(self._state.rows)]
        return trace_of(rows, numbers, ball=self._state.block.curtain.ball)


def device_status(side: Side, details: Mapping[str, str]) -> DeviceStatus:
    """Return what a hand holds, from the details of its agent."""
    held = held_by(details)
    return DeviceStatus(side, str(held.kind), held.model, held.serial, held.text)


def moved_by_server(side: Side, mover: str) -> DeviceStatus:
    """Return what moves a hand that no device moves."""
    return DeviceStatus(side, mover, "", "", MOVED_BY_SERVER[mover])


def plan_of(config: Config) -> dict[str, Any]:
    """Return the fields of a `Status` that identify session and block."""
    session, block = config.session, config.block
    return {
        **{name: getattr(session, name) for name in ("name", "dyad", "study", "pilot", "consent")},
        "block": block.number,
        "blocks": block.blocks,
        "label": block.label,
        "condition": f"{block.configuration}, force {block.force.replace('_', ' ')}",
    }


def words_of(config: Config) -> str:
    """Return the label of a block, or its condition."""
    plan = plan_of(for_operator(config))
    return str(plan["label"] or plan["condition"])


def trace_of(rows: NDArray[Any], numbers: Iterable[int], *, ball: bool) -> Trace:
    """Return a trace of these ticks; without a ball its position is NaN."""
    values = (rows[name].tolist() if ball or name != "p" else [nan] * len(rows) for name in _TRACED)
    return Trace(tuple(map(TracePoint._make, zip(numbers, *values, strict=True))))
