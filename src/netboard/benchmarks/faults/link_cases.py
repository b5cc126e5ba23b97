"""Faults of the links between agents and server: by relays, and by pulling real (virtual Ethernet) cables."""

from netboard.base.config import SIDES
from netboard.benchmarks.faults.case import (
    CABLED,
    DISTRUSTED,
    FALLS,
    LEFT,
    LEFT_FALLS,
    OUTAGE,
    PAUSED,
    RELAYED,
    REMEMBERED,
    RIGHT,
    Case,
)
from netboard.benchmarks.faults.checks import Check, either, falls, goes_on, paused, rendered_known, told
from netboard.benchmarks.faults.harm import (
    Act,
    blow,
    cut,
    distrust,
    double,
    hold,
    pull_cable,
    swallow,
    together,
)
from netboard.benchmarks.faults.relay import FAIR, Weather
from netboard.benchmarks.faults.sites import Setup

_ANY = f"the trial goes on, or is {PAUSED}"


def _case(name: str, done: str, expected: str, act: Act, *checks: Check, setup: Setup = RELAYED) -> Case:
    return Case(name, "links", done, expected, setup, act, checks)


def _gone(name: str, done: str, act: Act, also: str = "", setup: Setup = RELAYED) -> Case:
    """Return a case in which the left agent is out of reach longer than the timeout, so the trial pauses."""
    expected = f"{LEFT_FALLS}{PAUSED}; {also}{REMEMBERED}"
    return _case(name, done, expected, act, falls("left"), paused(*OUTAGE), rendered_known("left"), setup=setup)


def _missed(name: str, done: str, act: Act, setup: Setup = RELAYED) -> Case:
    """Return a case in which the left agent is out of reach so briefly that the trial may go on."""
    expected = f"the left force begins to fall in time; {_ANY}"
    return _case(name, done, expected, act, falls("left", to_zero=False), either(*OUTAGE), setup=setup)


def _blown(name: str, done: str, expected: str, *checks: Check, up: Weather = FAIR, down: Weather = FAIR) -> Case:
    """Return a case that degrades the left agent's line for 3 s."""
    return _case(name, done, expected, blow(LEFT, up, down), *checks)


def _blown_each_way(name: str, done: str, expected: str, check: Check, weather: Weather) -> Case:
    return _blown(name, done, expected, check, up=weather, down=weather)


LINKS = (
    _missed(
        "line-held-20ms",
        "the link between an agent and the server holds all bytes for 20 ms",
        hold(LEFT, 0.02),
    ),
    _gone("line-held-200ms", "the same for 200 ms", hold(LEFT, 0.2)),
    _gone("line-held-5s", "the same for 5 s", hold(LEFT, 5.0)),
    _case(
        "lines-held-200ms",
        "the same on the lines of both agents for 200 ms",
        FALLS + PAUSED,
        together(hold(LEFT, 0.2), hold(RIGHT, 0.2)),
        *(falls(*SIDES), paused("agent", "not armed")),
    ),
    _gone("line-cut-20ms", "an agent's connections are reset, and new ones for 20 ms", cut(LEFT, 0.02)),
    _gone("line-cut-200ms", "the same for 200 ms", cut(LEFT, 0.2)),
    _gone("line-cut-5s", "the same for 5 s", cut(LEFT, 5.0)),
    _gone(
        "black-hole",
        "an agent's connections are reset; new ones are accepted and swallow everything for 2 s",
        swallow(LEFT, 2.0),
    ),
    _gone(
        "doubled",
        "an agent's connections are reset, and made twice for 2 s: the server gets every byte twice",
        double(LEFT),
        "one of the two is accepted; ",
    ),
    _blown_each_way(
        "delay-1ms",
        "1 ms each way on an agent's line for 3 s",
        "the trial goes on",
        goes_on,
        Weather(0.001),
    ),
    _blown_each_way("delay-10ms", "10 ms each way", "the trial goes on", goes_on, Weather(0.01)),
    _blown("delay-20ms-up", "20 ms from agent to server only", _ANY, either(*OUTAGE), up=Weather(0.02)),
    _blown(
        "delay-20ms-down",
        "20 ms from server to agent only",
        f"the left force begins to fall where the delay begins; {_ANY}",
        *(falls("left", to_zero=False), either(*OUTAGE)),
        down=Weather(0.02),
    ),
    _blown_each_way(
        "delay-50ms",
        "50 ms each way",
        f"{PAUSED}; not resumed before it is over",
        paused(*OUTAGE),
        Weather(0.05),
    ),
    _blown_each_way("jitter-20ms", "up to 20 ms each way, at random", _ANY, either(*OUTAGE), Weather(jitter=0.02)),
    _blown_each_way(
        "loss",
        "stalls of 200 ms, as by TCP retransmission, twice a second on average",
        _ANY,
        either(*OUTAGE),
        Weather(stalls=1.0),
    ),
    _blown(
        "throttled",
        "50 kB/s from agent to server, a third of what is sent",
        f"{PAUSED}: samples that had to wait do not count",
        paused(*OUTAGE),
        up=Weather(rate=5e4),
    ),
    _case(
        "clock-unknown",
        "an agent is restarted over a line with 5 ms each way: its clock offset cannot be known to 0.5 ms",
        "its device is not armed, and the server says why, until the line is better",
        distrust(LEFT, Weather(0.005)),
        *(paused("left agent"), told("waiting for", "the left agent's clock")),
        setup=DISTRUSTED,
    ),
    _missed("cable-20ms", "the cable of a station (veth) is pulled for 20 ms", pull_cable(LEFT, 0.02), CABLED),
    _gone("cable-200ms", "the same for 200 ms", pull_cable(LEFT, 0.2), setup=CABLED),
    _gone("cable-5s", "the same for 5 s", pull_cable(LEFT, 5.0), setup=CABLED),
)
"""Link cases."""
