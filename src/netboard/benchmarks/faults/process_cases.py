"""Faults of processes of all four kinds: killed and restarted, or suspended."""

from dataclasses import replace

from netboard.base.config import SIDES
from netboard.benchmarks.faults.case import (
    DISPLAY,
    DYAD,
    FALLS,
    GOES_ON,
    LEFT,
    LOGGED,
    LOGGER,
    OUTAGE,
    PAUSED,
    SERVED,
    SERVER,
    SHOWN,
    UNNOTICED,
    UNSPILLED,
    Case,
)
from netboard.benchmarks.faults.checks import Check, either, falls, noted, paused, shown, told
from netboard.benchmarks.faults.harm import (
    Act,
    hold,
    kill,
    kill_logger_until_it_matters,
    kill_with_peer_frozen,
    stand_still,
)
from netboard.benchmarks.faults.sites import Setup

_ARTICLES = {LEFT: "an", DISPLAY: "a", SERVER: "the", LOGGER: "the"}
_SHOWN = GOES_ON + "; frames are shown again"
_SPILLS = "the trial goes on; the ring spills, and nothing is lost"
_STOOD_STILL = (paused("stalled"), noted("stood_still"))
_UNSEEN = (*UNNOTICED, shown("left"))


def _case(name: str, setup: Setup, done: str, expected: str, act: Act, *checks: Check) -> Case:
    return Case(name, "processes", done, expected, setup, act, checks)


def _stopped(process: str, name: str, seconds: float, setup: Setup, expected: str, *checks: Check) -> Case:
    """Return a case that suspends a process for a duration [s]."""
    time = f"{seconds:g} s" if seconds >= 1.0 else f"{seconds * 1e3:g} ms"
    done = f"SIGSTOP of {_ARTICLES[process]} {name} for {time}"
    act = stand_still(process, seconds)
    return _case(f"{name}-stopped-{time.replace(' ', '')}", setup, done, expected, act, *checks)


PROCESSES = (
    _case(
        "agent-killed",
        DYAD,
        "kill -9 of an agent, restarted after 1 s",
        PAUSED,
        kill(LEFT),
        *(paused("left agent"), noted("agent_joined", "left")),
    ),
    _stopped(LEFT, "agent", 0.05, DYAD, f"the trial goes on, or is {PAUSED}", either(*OUTAGE)),
    _stopped(LEFT, "agent", 1.0, DYAD, PAUSED, paused(*OUTAGE)),
    _stopped(LEFT, "agent", 10.0, DYAD, PAUSED, paused(*OUTAGE)),
    _case(
        "server-killed",
        SERVED,
        "kill -9 of the server, restarted after 1 s",
        FALLS + "a new session with a recording of its own; the old one is whole up to its last records",
        kill(SERVER),
        *(falls(*SIDES), noted("session_started")),
    ),
    _case(
        "other-session",
        SERVED,
        "an agent is suspended while the server is killed and restarted, and resumes in a session that has ended",
        "it gets no force before it has joined the new session; the right force falls in time",
        kill_with_peer_frozen,
        *(falls("right"), noted("session_started"), noted("agent_joined", "left")),
    ),
    _stopped(
        *(SERVER, "server", 0.05, SERVED, f"both forces begin to fall in time; {PAUSED}"),
        *(falls(*SIDES, to_zero=False), *_STOOD_STILL),
    ),
    _stopped(SERVER, "server", 1.0, SERVED, FALLS + PAUSED, falls(*SIDES), *_STOOD_STILL),
    _stopped(SERVER, "server", 10.0, SERVED, FALLS + PAUSED, falls(*SIDES), *_STOOD_STILL),
    _case("logger-killed", LOGGED, "kill -9 of the logger, restarted after 1 s", GOES_ON, kill(LOGGER), *UNNOTICED),
    _case(
        "logger-away-60s",
        LOGGED,
        "kill -9 of the logger, restarted after 60 s; the ring holds 3 s",
        _SPILLS,
        kill(LOGGER, 60.0, 6.0),
        *(*UNNOTICED, noted("log_spilling"), noted("logger_joined")),
    ),
    _case(
        "logger-away-unspilled",
        UNSPILLED,
        "the same, with no room to spill to, until 10 s after the server has noticed",
        "paused before anything is lost; what is lost then is listed with its cause",
        kill_logger_until_it_matters,
        *(told("notice", "the logger is too far behind"), noted("log_lost")),
    ),
    _stopped(LOGGER, "logger", 0.05, LOGGED, GOES_ON, *UNNOTICED),
    _stopped(LOGGER, "logger", 1.0, LOGGED, GOES_ON, *UNNOTICED),
    # Alone: after other cases the spill may not have been taken yet, and would not begin anew.
    replace(_stopped(LOGGER, "logger", 10.0, LOGGED, _SPILLS, *UNNOTICED, noted("log_spilling")), alone=True),
    _case("display-killed", SHOWN, "kill -9 of a display, restarted after 1 s", _SHOWN, kill(DISPLAY), *_UNSEEN),
    _stopped(DISPLAY, "display", 0.05, SHOWN, _SHOWN, *_UNSEEN),
    _stopped(DISPLAY, "display", 1.0, SHOWN, _SHOWN, *_UNSEEN),
    _stopped(DISPLAY, "display", 10.0, SHOWN, _SHOWN, *_UNSEEN),
    _case(
        "display-not-reading",
        SHOWN,
        "a display's connections stay, and nothing is read from them for 10 s",
        _SHOWN,
        hold(DISPLAY, 10.0, 2.0),
        *_UNSEEN,
    ),
)
"""Process cases."""
