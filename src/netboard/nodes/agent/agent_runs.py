"""Undisturbed ticks of an agent, in one compiled call from reading the stylus to the rendered force.

In a loop that sleeps most of the time a line of Python takes several microseconds, and a tick in single steps needs
some hundred lines. If the device can be accessed by compiled code, most ticks need no Python. Python takes over when
the stylus source is due, and for everything else: messages in another form, a long silence of the server, a fault of
the device. It then continues the tick with the single steps of `netboard.nodes.agent.agent`. Both call the same kernels
(`netboard.nodes.agent.rules`): no rule is written here.
"""

from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from netboard.base.clock import CATCH_UP_TICKS
from netboard.base.compiled import composed, inlined, kernel, machine_code, waiting
from netboard.base.tick import LEAD_NS, TICK_NS
from netboard.devices.contract.access import CompiledAccess, Fields, Kernel
from netboard.network.protocol.joining import HELLO_INTERVAL_NS
from netboard.network.transport import fastpath
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.agent.motion_link import POINT, MotionLink, close_loop, send_sample
from netboard.nodes.agent.rendered_buffer import RenderedRing, remember
from netboard.nodes.agent.rules import LIMITED, Rules, apply_reading, await_limited_force, limited_force

SHIFT_SHARE = 0.02
"""Share of the phase error that is corrected with each message [1]."""

MAX_SHIFT_NS = 5_000
"""Largest phase shift in a tick, which keeps the interval of the samples within 0.5 % of 1 ms [ns]."""

ANSWER_NS = TICK_NS - TICK_NS // 4
"""Time for which a tick waits for its first answer, before the stylus source runs [ns]."""

NEVER_DUE_NS = 2**62
"""When a stylus source is due that waits for a signal of its file only [ns]."""

NOT_BEGUN, SENT, LATE, ANSWERED = range(4)
"""How far a tick has come: nothing is done; the sample is sent; no answer came within `ANSWER_NS`; an answer's force is
rendered."""


class RunProgress(NamedTuple):
    """State of an agent between two samples."""

    due_ns: int  # when the present tick was due [ns]
    seq: int  # number of the next sample
    safeguards: int  # actions of the safety chain since the newest sample
    rendered: float  # vertical force handed to the device last [N]


class Begun(NamedTuple):
    """What has been done of a tick that Python must continue."""

    stage: int  # how far it has come, as `NOT_BEGUN`
    came: int  # why the last wait for an answer ended: a result of `wait_for_answer`
    shift_ns: int  # how much later to send the next sample [ns]


NOTHING_BEGUN = Begun(NOT_BEGUN, fastpath.NOTHING, 0)
NO_READING: Fields = (0, *(0.0,) * 6, 0, False)

_BEHIND_NS = CATCH_UP_TICKS * TICK_NS


@inlined
def _limited_shift(shift_ns: int) -> int:
    return min(max(shift_ns, -MAX_SHIFT_NS), MAX_SHIFT_NS)


@kernel
def phase_shift(lead_ns: int) -> int:
    """Return how much later to send the next sample [ns], for one that arrived this long before its deadline [ns]."""
    # Wrapped to half a tick: a sample that misses its tick is early for the next one.
    error = (lead_ns - LEAD_NS + TICK_NS // 2) % TICK_NS - TICK_NS // 2
    return _limited_shift(round(SHIFT_SHARE * error))


@kernel
def shifted(shift_ns: int, lead_ns: int) -> int:
    """Return the phase shift of a tick after one more answer, within the limit of a tick [ns]."""
    return _limited_shift(shift_ns + phase_shift(lead_ns))


def _read(parts: tuple[Any, ...], now_ns: int) -> tuple[bool, Fields]:
    """Stand for the reading of a device."""
    return False, (now_ns, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, False)


def _write(parts: tuple[Any, ...], fx: float, fy: float, fz: float) -> None:
    """Stand for the writing of a device."""


def _live(parts: tuple[Any, ...], now_ns: int) -> None:
    """Stand for what a device does right after a force."""


@kernel
def _may_begin(state: np.void, now_ns: int, due_ns: int) -> bool:
    """Return whether the next tick may run without Python, as far as is known before the reading."""
    return bool(
        now_ns - due_ns <= _BEHIND_NS
        and state["in_session"]
        and state["kind"] != POINT  # an own force does not wait for an answer
        and now_ns - state["heard_ns"] < HELLO_INTERVAL_NS
    )


def _run(
    motion: tuple[Any, ...],
    parts: tuple[Any, ...],
    rules: Rules,
    progress: RunProgress,
    begun: Begun,
    reading: Fields,
    stop: int,
    source_ns: int,
    source_file: int,
) -> tuple[RunProgress, Begun, Fields]:
    """Run ticks until Python is due; return the progress, what has been done of the newest tick, and its reading.

    ``motion``, ``parts``: as in `run_of`. ``begun``, ``reading``: of the tick that the run continues, whose stylus
    source has been advanced; or `NOTHING_BEGUN`. ``stop``: number of the sample before which the run ends.
    ``source_ns``, ``source_file``: when Python must advance the stylus source [ns], or the file that signals it.
    """
    fast, frame, sample, link, rows = motion
    due_ns, seq, safeguards, rendered = progress
    stage, came, shift_ns = begun
    state, now_ns = link[0], fastpath.now_ns(fast)
    fast[0]["watched"], fast[0]["signalled"] = source_file, 0
    until_ns = due_ns + TICK_NS + shift_ns
    while True:
        if stage == NOT_BEGUN:
            if seq >= stop or not _may_begin(state, now_ns, due_ns):
                break
            found, reading = _read(parts, now_ns)
            if not found:
                break
            stamp_ns, x, y, z, vx, vy, vz, buttons, ready = reading
            safeguards = apply_reading(link, rules, seq, z, buttons, ready, safeguards)
            remember(rows, seq, stamp_ns, rendered, safeguards)
            sample_of = (seq, stamp_ns, x, y, z, vx, vy, vz, buttons, safeguards, rendered)
            if send_sample(fast, sample, link, *sample_of) == fastpath.FAILED:
                came = fastpath.FAILED
            stage, seq, safeguards, until_ns = SENT, seq + 1, 0, due_ns + ANSWER_NS
        is_source_due = False
        stamp_ns, x, y, z, vx, vy, vz, _, _ = reading
        hand = stamp_ns, x, y, z, vx, vy, vz
        while came == fastpath.NOTHING and not is_source_due:
            came, fx, fy, fz, bits = await_limited_force(fast, frame, link, rules, until_ns, True, *hand, rendered)
            now_ns = fastpath.now_ns(fast)
            is_first = stage == SENT
            if came == LIMITED:
                _write(parts, fx, fy, fz)
                close_loop(link, now_ns)
                came, stage, rendered, safeguards = fastpath.NOTHING, ANSWERED, fz, safeguards | bits
                shift_ns = shifted(shift_ns, state["lead_ns"])
            if is_first and came == fastpath.NOTHING:
                stage = max(stage, LATE)
                _live(parts, now_ns)
                is_source_due = now_ns >= source_ns or fast[0]["signalled"] != 0
            until_ns = due_ns + TICK_NS + shift_ns
            if now_ns >= until_ns:  # however many answers there are
                break
        if is_source_due or came != fastpath.NOTHING:
            break
        if stage == LATE:
            fx, fy, fz, bits = limited_force(link, rules, now_ns, *hand, rendered)
            _write(parts, fx, fy, fz)
            close_loop(link, now_ns)
            rendered, safeguards = fz, safeguards | bits
        due_ns, stage, shift_ns = until_ns, NOT_BEGUN, 0
    fast[0]["watched"] = NO_FILE  # which may be closed before the next run
    return RunProgress(due_ns, seq, safeguards, rendered), Begun(stage, came, shift_ns), reading


@cache
def _composed(read: Kernel, write: Kernel, live: Kernel) -> Kernel:
    return composed(_run, waiting, _read=read, _write=write, _live=live)


def run_of(access: CompiledAccess, link: MotionLink, ring: RenderedRing, rules: Rules) -> Kernel:
    """Compile the undisturbed ticks of an agent, or load them from the cache.

    Returns a function of the other arguments of `_run`.
    """
    motion = link.fast, link.frame, link.sample, link.state, ring.rows
    fixed_arguments = motion, access.parts, rules
    run = _composed(access.read, access.write, access.live)
    others = RunProgress(0, 0, 0, 0.0), NOTHING_BEGUN, NO_READING, 0, 0, 0
    return partial(machine_code(run, *fixed_arguments, *others), *fixed_arguments)
