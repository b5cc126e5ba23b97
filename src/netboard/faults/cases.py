"""The table of faults: what is done, in words and as a function, and what must happen, in words and as checks.

Some things must hold after every fault, and are not repeated in the table: no step of a force larger than the slew
limit, no vertical force while a trial is paused, every tick recorded or listed as lost with its cause, a trial on again
at the end, and nothing of it noticed by another dyad on the same server.
"""

from dataclasses import dataclass

from netboard.config import Side
from netboard.faults.checks import (
    Check,
    back,
    either,
    falls,
    gentle,
    goes_on,
    neighbour_unmoved,
    noted,
    nothing_lost,
    paused,
    powerless,
    rests,
    safeguarded,
    shown,
    told,
    whole,
)
from netboard.faults.harm import (
    SAMPLE,
    Act,
    blow,
    cut,
    distrust,
    double,
    fill_disk,
    flood,
    hold,
    kill,
    kill_with_peer_frozen,
    pull_cable,
    remove_directory,
    say,
    second_agent,
    set_wall_clock,
    speak_other_version,
    stand_still,
    swallow,
    together,
    trick,
    trick_and_restart,
)
from netboard.faults.relay import Weather
from netboard.faults.sites import Setup
from netboard.wire.codec import encode
from netboard.wire.messages import Safeguard

LEFT, RIGHT, SERVER, LOGGER, DISPLAY = "left agent", "right agent", "server", "logger", "left display"

DYAD = Setup("two dyads on one server", neighbour=True)
SERVED = Setup("one dyad", follow=True)
LOGGED = Setup("one dyad, a log ring of 3 s", settings=("network.log_ring_s=3",))
UNSPILLED = Setup("one dyad, a log ring of 3 s, no spill", ("network.log_ring_s=3", "network.log_spill_mb=0"))
SHOWN = Setup("one dyad with displays, the left one's line through a relay", relayed=(DISPLAY,), displays=True)
RELAYED = Setup(
    "two dyads, the agents of one through relays",
    settings=("network.clock_bound_ms=100",),
    relayed=(LEFT, RIGHT),
    neighbour=True,
)
DISTRUSTED = Setup("one dyad, its agents through relays", relayed=(LEFT, RIGHT))
CABLED = Setup("one dyad, real links", spaces=True)
CLOCKED = Setup("one dyad, a wall clock that can be set", wall_clock=True)
SMALL_DISK = Setup("one dyad, a small disk", small_disk=True)
SINGLE = Setup("one dyad")


@dataclass(frozen=True)
class Case:
    """One fault.

    Attributes
    ----------
    name : str
        What it is called.
    part : str
        Name of the table it belongs to.
    done : str
        What is done, for people.
    expected : str
        What must happen, for people, on top of what must hold after every fault.
    setup : Setup
        Where.
    act : callable
        Does it.
    checks : tuple of callable
        What must hold, on top of what must hold after every fault.
    cut : str or None
        Side whose force may be cut to zero at once.
    alone : bool
        Needs a site of its own.
    quick : bool
        Part of the short form.
    """

    name: str
    part: str
    done: str
    expected: str
    setup: Setup
    act: Act
    checks: tuple[Check, ...]
    cut: Side | None = None
    alone: bool = False
    quick: bool = True

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """Everything that must hold."""
        return (*self.checks, gentle(self.cut), rests(), whole(), back, neighbour_unmoved)


_PAUSED = "paused, marked, repeated"
_GOES_ON = "the trial goes on, nothing is lost"
_FALLS = "both forces fall in time and are zero in time; "
_LEFT_FALLS = "the left force falls in time and is zero in time; "
_REFUSED = "refused and recorded; the trial goes on"

_BOTH: tuple[Side, Side] = ("left", "right")
_OUTAGE = ("no sample from the left agent", "not armed", "the left agent")
_UNNOTICED = (goes_on(), nothing_lost())

PROCESSES = (
    Case(
        "agent-killed",
        "processes",
        "kill -9 of an agent, started again after 1 s",
        _PAUSED,
        DYAD,
        kill(LEFT),
        (paused("left agent"), noted("agent_joined", "left")),
    ),
    Case(
        "agent-stopped-50ms",
        "processes",
        "SIGSTOP of an agent for 50 ms",
        f"the trial goes on, or is {_PAUSED}",
        DYAD,
        stand_still(LEFT, 0.05),
        (either(*_OUTAGE),),
    ),
    Case(
        "agent-stopped-1s",
        "processes",
        "SIGSTOP of an agent for 1 s",
        _PAUSED,
        DYAD,
        stand_still(LEFT, 1.0),
        (paused(*_OUTAGE),),
    ),
    Case(
        "agent-stopped-10s",
        "processes",
        "SIGSTOP of an agent for 10 s",
        _PAUSED,
        DYAD,
        stand_still(LEFT, 10.0),
        (paused(*_OUTAGE),),
        quick=False,
    ),
    Case(
        "server-stopped-50ms",
        "processes",
        "SIGSTOP of the server for 50 ms",
        f"both forces begin to fall in time; {_PAUSED}",
        SERVED,
        stand_still(SERVER, 0.05),
        (falls(*_BOTH, to_zero=False), paused("stood still"), noted("stood_still")),
    ),
    Case(
        "server-stopped-1s",
        "processes",
        "SIGSTOP of the server for 1 s",
        _FALLS + _PAUSED,
        SERVED,
        stand_still(SERVER, 1.0),
        (falls(*_BOTH), paused("stood still"), noted("stood_still")),
    ),
    Case(
        "server-stopped-10s",
        "processes",
        "SIGSTOP of the server for 10 s",
        _FALLS + _PAUSED,
        SERVED,
        stand_still(SERVER, 10.0),
        (falls(*_BOTH), paused("stood still"), noted("stood_still")),
        quick=False,
    ),
    Case(
        "server-killed",
        "processes",
        "kill -9 of the server, started again after 1 s",
        _FALLS + "a new session with a recording of its own, the old one whole up to its last records",
        SERVED,
        kill(SERVER),
        (falls(*_BOTH), noted("session_started")),
    ),
    Case(
        "other-session",
        "processes",
        "an agent stands still while the server is killed and started again, and wakes in a session that is over",
        "it is given no force before it belongs to the new session; the right force falls in time",
        SERVED,
        kill_with_peer_frozen,
        (falls("right"), noted("session_started"), noted("agent_joined", "left")),
    ),
    Case(
        "logger-killed",
        "processes",
        "kill -9 of the logger, started again after 1 s",
        _GOES_ON,
        LOGGED,
        kill(LOGGER),
        _UNNOTICED,
    ),
    Case(
        "logger-stopped-50ms",
        "processes",
        "SIGSTOP of the logger for 50 ms",
        _GOES_ON,
        LOGGED,
        stand_still(LOGGER, 0.05),
        _UNNOTICED,
        quick=False,
    ),
    Case(
        "logger-stopped-1s",
        "processes",
        "SIGSTOP of the logger for 1 s",
        _GOES_ON,
        LOGGED,
        stand_still(LOGGER, 1.0),
        _UNNOTICED,
    ),
    Case(
        "logger-stopped-10s",
        "processes",
        "SIGSTOP of the logger for 10 s",
        "the trial goes on; the ring spills, and nothing is lost",
        LOGGED,
        stand_still(LOGGER, 10.0),
        (*_UNNOTICED, noted("log_spilling")),
        quick=False,
    ),
    Case(
        "logger-away-60s",
        "processes",
        "kill -9 of the logger, started again after 60 s; the ring holds 3 s",
        "the trial goes on; the ring spills, and nothing is lost",
        LOGGED,
        kill(LOGGER, 60.0, 6.0),
        (*_UNNOTICED, noted("log_spilling"), noted("logger_joined")),
    ),
    Case(
        "logger-away-unspilled",
        "processes",
        "the same for 10 s, with no room to spill to",
        f"{_PAUSED} before anything is lost; what is lost then is listed with its cause",
        UNSPILLED,
        kill(LOGGER, 10.0, 6.0),
        (paused("the logger is too far behind"), noted("log_lost")),
    ),
    Case(
        "display-killed",
        "processes",
        "kill -9 of a display, started again after 1 s",
        _GOES_ON + ", frames are shown again",
        SHOWN,
        kill(DISPLAY),
        (*_UNNOTICED, shown("left")),
    ),
    Case(
        "display-stopped-50ms",
        "processes",
        "SIGSTOP of a display for 50 ms",
        _GOES_ON + ", frames are shown again",
        SHOWN,
        stand_still(DISPLAY, 0.05),
        (*_UNNOTICED, shown("left")),
        quick=False,
    ),
    Case(
        "display-stopped-1s",
        "processes",
        "SIGSTOP of a display for 1 s",
        _GOES_ON + ", frames are shown again",
        SHOWN,
        stand_still(DISPLAY, 1.0),
        (*_UNNOTICED, shown("left")),
    ),
    Case(
        "display-stopped-10s",
        "processes",
        "SIGSTOP of a display for 10 s",
        _GOES_ON + ", frames are shown again",
        SHOWN,
        stand_still(DISPLAY, 10.0),
        (*_UNNOTICED, shown("left")),
        quick=False,
    ),
    Case(
        "display-not-reading",
        "processes",
        "a display's connections stay and nothing is read from them for 10 s",
        _GOES_ON + ", frames are shown again",
        SHOWN,
        hold(DISPLAY, 10.0, 2.0),
        (*_UNNOTICED, shown("left")),
    ),
)

LINKS = (
    Case(
        "line-held-20ms",
        "links",
        "nothing passes between an agent and the server for 20 ms, all of it comes later",
        "the left force begins to fall in time; the trial goes on",
        RELAYED,
        hold(LEFT, 0.02),
        (falls("left", to_zero=False), either(*_OUTAGE)),
    ),
    Case(
        "line-held-200ms",
        "links",
        "the same for 200 ms",
        _LEFT_FALLS + _PAUSED,
        RELAYED,
        hold(LEFT, 0.2),
        (falls("left"), paused(*_OUTAGE)),
    ),
    Case(
        "line-held-5s",
        "links",
        "the same for 5 s",
        _LEFT_FALLS + _PAUSED,
        RELAYED,
        hold(LEFT, 5.0),
        (falls("left"), paused(*_OUTAGE)),
        quick=False,
    ),
    Case(
        "line-cut-20ms",
        "links",
        "an agent's connections are reset, and new ones refused for 20 ms",
        _LEFT_FALLS + _PAUSED,
        RELAYED,
        cut(LEFT, 0.02),
        (falls("left"), paused(*_OUTAGE)),
    ),
    Case(
        "line-cut-200ms",
        "links",
        "the same for 200 ms",
        _LEFT_FALLS + _PAUSED,
        RELAYED,
        cut(LEFT, 0.2),
        (falls("left"), paused(*_OUTAGE)),
        quick=False,
    ),
    Case(
        "line-cut-5s",
        "links",
        "the same for 5 s",
        _LEFT_FALLS + _PAUSED,
        RELAYED,
        cut(LEFT, 5.0),
        (falls("left"), paused(*_OUTAGE)),
        quick=False,
    ),
    Case(
        "both-lines-held-200ms",
        "links",
        "nothing passes on both agents' lines for 200 ms",
        _FALLS + _PAUSED,
        RELAYED,
        together(hold(LEFT, 0.2), hold(RIGHT, 0.2)),
        (falls(*_BOTH), paused("agent", "not armed")),
        quick=False,
    ),
    Case(
        "black-hole",
        "links",
        "an agent's connections are reset; new ones are accepted and swallow everything for 2 s",
        _LEFT_FALLS + _PAUSED,
        RELAYED,
        swallow(LEFT, 2.0),
        (falls("left"), paused(*_OUTAGE)),
    ),
    Case(
        "doubled",
        "links",
        "an agent's connections are reset, and made twice for 2 s: the server gets every byte twice",
        f"the left force falls in time; {_PAUSED}; the copy gets nothing done",
        RELAYED,
        double(LEFT),
        (falls("left"), paused(*_OUTAGE)),
    ),
    Case(
        "delay-1ms",
        "links",
        "1 ms each way on an agent's line for 3 s",
        "the trial goes on",
        RELAYED,
        blow(LEFT, Weather(0.001), Weather(0.001)),
        (goes_on(),),
        quick=False,
    ),
    Case(
        "delay-10ms",
        "links",
        "10 ms each way",
        "the trial goes on",
        RELAYED,
        blow(LEFT, Weather(0.01), Weather(0.01)),
        (goes_on(),),
    ),
    Case(
        "delay-20ms-up",
        "links",
        "20 ms from agent to server only",
        "the left force begins to fall where it starts; the trial goes on",
        RELAYED,
        blow(LEFT, up=Weather(0.02)),
        (either(*_OUTAGE),),
    ),
    Case(
        "delay-20ms-down",
        "links",
        "20 ms from server to agent only",
        "the left force begins to fall where it starts; the trial goes on",
        RELAYED,
        blow(LEFT, down=Weather(0.02)),
        (falls("left", to_zero=False), either(*_OUTAGE)),
        quick=False,
    ),
    Case(
        "delay-50ms",
        "links",
        "50 ms each way",
        f"{_PAUSED}; not resumed before it is over",
        RELAYED,
        blow(LEFT, Weather(0.05), Weather(0.05)),
        (paused(*_OUTAGE),),
    ),
    Case(
        "jitter-20ms",
        "links",
        "up to 20 ms each way, at random",
        f"the trial goes on, or is {_PAUSED}",
        RELAYED,
        blow(LEFT, Weather(jitter=0.02), Weather(jitter=0.02)),
        (either(*_OUTAGE),),
    ),
    Case(
        "loss",
        "links",
        "stalls of 200 ms, as TCP makes of lost packets, once a second on average, both ways",
        f"the left force falls in time each time; {_PAUSED}",
        RELAYED,
        blow(LEFT, Weather(stalls=1.0), Weather(stalls=1.0), 6.0, 3.0),
        (either(*_OUTAGE),),
        quick=False,
    ),
    Case(
        "throttled",
        "links",
        "an agent's line takes 50 kB/s, a third of what is sent",
        f"{_PAUSED}: samples that waited do not count",
        RELAYED,
        blow(LEFT, up=Weather(rate=5e4)),
        (paused(*_OUTAGE),),
        quick=False,
    ),
    Case(
        "clock-unknown",
        "links",
        "an agent is started again over a line of 5 ms each way, so that its clock cannot be known to 0.5 ms",
        "its device is not armed, and the server says why, until the line is better",
        DISTRUSTED,
        distrust(LEFT, Weather(0.005)),
        (paused("left agent"), told("waiting for", "the left agent's clock")),
    ),
    Case(
        "cable-20ms",
        "links",
        "a station's cable (veth) is pulled for 20 ms",
        f"the left force begins to fall in time; the trial goes on, or is {_PAUSED}",
        CABLED,
        pull_cable(LEFT, 0.02),
        (falls("left", to_zero=False), either(*_OUTAGE)),
    ),
    Case(
        "cable-200ms",
        "links",
        "the same for 200 ms",
        _LEFT_FALLS + _PAUSED,
        CABLED,
        pull_cable(LEFT, 0.2),
        (falls("left"), paused(*_OUTAGE)),
    ),
    Case(
        "cable-5s",
        "links",
        "the same for 5 s",
        _LEFT_FALLS + _PAUSED,
        CABLED,
        pull_cable(LEFT, 5.0),
        (falls("left"), paused(*_OUTAGE)),
        quick=False,
    ),
)

PEERS = (
    Case(
        "two-agents",
        "peers",
        "a second agent claims a side",
        _REFUSED + "; its device is given no force",
        DYAD,
        second_agent,
        (
            goes_on(),
            noted("refused", "already has an agent"),
            told("answer", "already has an agent"),
            told("largest force of the second", "0 N"),
        ),
    ),
    Case(
        "other-version",
        "peers",
        "an agent of another version of the protocol says hello and sends samples",
        _REFUSED,
        DYAD,
        speak_other_version,
        (goes_on(), noted("refused", "speaks protocol"), told("answer", "speaks protocol")),
    ),
    Case(
        "no-hello",
        "peers",
        "samples from somebody who has not said hello, as of an agent of another session",
        _REFUSED,
        DYAD,
        say(encode(SAMPLE)),
        (goes_on(), noted("refused", "say hello first"), told("answer", "say hello first")),
    ),
    Case(
        "flood",
        "peers",
        "nonsense, greetings and samples on every channel as fast as they go, and connections that are no ZeroMQ",
        _REFUSED,
        DYAD,
        flood(),
        (goes_on(), noted("refused"), told("flood", "frames")),
    ),
)

DEVICES = (
    Case(
        "device-nan",
        "devices",
        "a device gives positions that are no numbers; then the agent is started again",
        f"its force is zero at once, and stays so; {_PAUSED}",
        DYAD,
        trick_and_restart(LEFT, "nan"),
        (paused(*_OUTAGE), powerless("left"), safeguarded("left", Safeguard.NOT_FINITE)),
        cut="left",
    ),
    Case(
        "device-frozen",
        "devices",
        "a device gives the same reading again and again for 1 s",
        _PAUSED,
        DYAD,
        trick(LEFT, "frozen"),
        (paused(*_OUTAGE),),
    ),
    Case(
        "device-jumps",
        "devices",
        "a device's position jumps by 10 cm, and back after 1 s",
        f"too fast: the force goes to zero by the slew limit; {_PAUSED}",
        DYAD,
        trick(LEFT, "jump"),
        (paused(*_OUTAGE), safeguarded("left", Safeguard.TOO_FAST)),
    ),
    Case(
        "device-gone",
        "devices",
        "a device does not answer any more; then the agent is started again with it",
        f"the agent tries to set zero force, says so and ends; {_PAUSED}",
        DYAD,
        trick_and_restart(LEFT, "gone"),
        (paused(*_OUTAGE), powerless("left"), told("exit code of the agent", "1")),
        cut="left",
    ),
)

MACHINES = (
    Case(
        "wall-clock",
        "machines",
        "the wall clock of all processes is set 1 h forward, 2 h back, 10 years forward, and right again",
        _GOES_ON,
        CLOCKED,
        set_wall_clock(3600, -3600, 315_360_000),
        _UNNOTICED,
    ),
    Case(
        "disk-low",
        "machines",
        "the recordings' disk is filled up to 100 MB",
        "the logger warns, ends the recording and says why; paused; a logger elsewhere goes on, nothing is lost",
        SMALL_DISK,
        fill_disk(100_000_000),
        (
            paused("the logger has left"),
            nothing_lost(),
            told("warning", "only"),
            told("logger", "exit code 1"),
            noted("logger_left", "free"),
        ),
        alone=True,
        quick=False,
    ),
    Case(
        "disk-full",
        "machines",
        "the recordings' disk is filled to the last byte",
        "the same: there is room for the end of the recording",
        SMALL_DISK,
        fill_disk(0),
        (
            paused("the logger has left"),
            nothing_lost(),
            told("logger", "exit code 1"),
            noted("logger_left"),
        ),
        alone=True,
    ),
    Case(
        "directory-removed",
        "machines",
        "the recordings' folder is deleted with the recording in it",
        "the logger saves what it wrote and says why; paused; a logger elsewhere goes on, nothing is lost",
        SINGLE,
        remove_directory,
        (paused("the logger has left"), nothing_lost(), told("logger", "exit code 1"), noted("logger_left")),
        alone=True,
    ),
)

CASES = (*PROCESSES, *LINKS, *PEERS, *DEVICES, *MACHINES)
"""All of them."""

PARTS = {
    "processes": "Processes killed and stopped",
    "links": "Links cut, slow and lossy",
    "peers": "Peers that do not belong",
    "devices": "Devices that fail",
    "machines": "Clocks and disks",
}
"""Titles of the tables."""
