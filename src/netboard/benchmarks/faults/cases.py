"""The fault cases: for each the action and the requirement, as text and as code. The attacks are in `attack_cases`.

Requirements after every fault are not repeated in the table: no force step above the slew limit, no vertical force
while a trial is paused, every tick recorded or listed as lost with its cause, no recording that `netboard check` calls
damaged, a running trial at the end, and no effect on another dyad on the same server.
"""

from dataclasses import dataclass, replace

from netboard.base.config import SIDES, Side
from netboard.benchmarks.faults import harm
from netboard.benchmarks.faults.checks import (
    Check,
    back,
    either,
    falls,
    gentle,
    goes_on,
    neighbour_unmoved,
    no_damage,
    noted,
    nothing_lost,
    paused,
    powerless,
    rendered_known,
    rests,
    safeguarded,
    shown,
    stopped,
    told,
    whole,
)
from netboard.benchmarks.faults.relay import FAIR, Weather
from netboard.benchmarks.faults.sites import Setup
from netboard.network.protocol.codec import encode
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.motion import Safeguard

LEFT, RIGHT, SERVER, LOGGER, DISPLAY = "left agent", "right agent", "server", "logger", "left display"

DYAD = Setup("two dyads on one server", neighbour=True)
SERVED = Setup("one dyad", follow=True)
LOGGED = Setup("one dyad, a log ring of 3 s", settings=("network.log_ring_s=3",))
UNSPILLED = Setup("one dyad, a log ring of 3 s, no spill", ("network.log_ring_s=3", "network.log_spill_mb=0"))
SHOWN = Setup("one dyad with displays, the left one's line through a relay", relayed=(DISPLAY,), displays=True)
RELAYED = Setup(
    "one dyad, its agents through relays, any clock",
    settings=("network.clock_bound_ms=100",),
    relayed=(LEFT, RIGHT),
)
"""No neighbour: the relays are not real-time processes, and two dyads leave them no time on two cores."""

DISTRUSTED = Setup("one dyad, its agents through relays", relayed=(LEFT, RIGHT))
CABLED = Setup("one dyad, real links", spaces=True)
CLOCKED = Setup("one dyad, a wall clock that can be set", wall_clock=True)
SMALL_DISK = Setup("one dyad, a small disk", small_disk=True)
SINGLE = Setup("one dyad")


@dataclass(frozen=True)
class Case:
    """One fault.

    - `expected`: required reaction, as text, in addition to the requirements after every fault.
    - `checks`: the checks of that reaction.
    """

    name: str
    part: str
    done: str
    expected: str
    setup: Setup
    act: harm.Act
    checks: tuple[Check, ...]
    cut: Side | None = None
    alone: bool = False

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """Return every check of this case."""
        return (*self.checks, gentle(self.cut), rests, whole, no_damage, back, neighbour_unmoved)


PARTS = {
    "processes": "Processes killed and stopped",
    "links": "Links cut, slow and lossy",
    "peers": "Unauthorised peers",
    "devices": "Devices that fail",
    "machines": "Clocks and disks",
    "attacks": "Peers that send too much",
}
"""Titles of the tables."""

# What many rows have in common.

PAUSED = "paused, marked, repeated"
REMEMBERED = "the recording has the force that the device was handed meanwhile"
GOES_ON = "the trial goes on, nothing is lost"
FALLS = "both forces fall in time and are zero in time; "
LEFT_FALLS = "the left force falls in time and is zero in time; "

OUTAGE = ("no sample from the left agent", "not armed", "the left agent")
"""Pause reasons of a trial that has lost an agent."""

UNNOTICED: tuple[Check, ...] = (goes_on, nothing_lost)

# --- processes killed and restarted, or suspended -----------------------------------------------------------------

_ARTICLES = {LEFT: "an", DISPLAY: "a", SERVER: "the", LOGGER: "the"}
_SHOWN = GOES_ON + "; frames are shown again"
_SPILLS = "the trial goes on; the ring spills, and nothing is lost"
_STOOD_STILL = (paused("stalled"), noted("stood_still"))
_UNSEEN = (*UNNOTICED, shown("left"))


def _process(name: str, setup: Setup, done: str, expected: str, act: harm.Act, *checks: Check) -> Case:
    return Case(name, "processes", done, expected, setup, act, checks)


def _suspended(process: str, name: str, seconds: float, setup: Setup, expected: str, *checks: Check) -> Case:
    """Return a case that suspends a process for a duration [s]."""
    time = f"{seconds:g} s" if seconds >= 1.0 else f"{seconds * 1e3:g} ms"
    done = f"SIGSTOP of {_ARTICLES[process]} {name} for {time}"
    act = harm.stand_still(process, seconds)
    return _process(f"{name}-stopped-{time.replace(' ', '')}", setup, done, expected, act, *checks)


PROCESSES = (
    _process(
        "agent-killed",
        DYAD,
        "kill -9 of an agent, restarted after 1 s",
        PAUSED,
        harm.kill(LEFT),
        *(paused("left agent"), noted("agent_joined", "left")),
    ),
    _suspended(LEFT, "agent", 0.05, DYAD, f"the trial goes on, or is {PAUSED}", either(*OUTAGE)),
    _suspended(LEFT, "agent", 1.0, DYAD, PAUSED, paused(*OUTAGE)),
    _suspended(LEFT, "agent", 10.0, DYAD, PAUSED, paused(*OUTAGE)),
    _process(
        "server-killed",
        SERVED,
        "kill -9 of the server, restarted after 1 s",
        FALLS + "a new session with a recording of its own; the old one is whole up to its last records",
        harm.kill(SERVER),
        *(falls(*SIDES), noted("session_started")),
    ),
    _process(
        "other-session",
        SERVED,
        "an agent is suspended while the server is killed and restarted, and resumes in a session that has ended",
        "it gets no force before it has joined the new session; the right force falls in time",
        harm.kill_with_peer_frozen,
        *(falls("right"), noted("session_started"), noted("agent_joined", "left")),
    ),
    _suspended(
        *(SERVER, "server", 0.05, SERVED, f"both forces begin to fall in time; {PAUSED}"),
        *(falls(*SIDES, to_zero=False), *_STOOD_STILL),
    ),
    _suspended(SERVER, "server", 1.0, SERVED, FALLS + PAUSED, falls(*SIDES), *_STOOD_STILL),
    _suspended(SERVER, "server", 10.0, SERVED, FALLS + PAUSED, falls(*SIDES), *_STOOD_STILL),
    _process(
        "logger-killed", LOGGED, "kill -9 of the logger, restarted after 1 s", GOES_ON, harm.kill(LOGGER), *UNNOTICED
    ),
    _process(
        "logger-away-60s",
        LOGGED,
        "kill -9 of the logger, restarted after 60 s; the ring holds 3 s",
        _SPILLS,
        harm.kill(LOGGER, 60.0, 6.0),
        *(*UNNOTICED, noted("log_spilling"), noted("logger_joined")),
    ),
    _process(
        "logger-away-unspilled",
        UNSPILLED,
        "the same, with no room to spill to, until 10 s after the server has noticed",
        "paused before anything is lost; what is lost then is listed with its cause",
        harm.kill_logger_until_it_matters,
        *(told("notice", "the logger is too far behind"), noted("log_lost")),
    ),
    _suspended(LOGGER, "logger", 0.05, LOGGED, GOES_ON, *UNNOTICED),
    _suspended(LOGGER, "logger", 1.0, LOGGED, GOES_ON, *UNNOTICED),
    # Alone: after other cases the spill may not have been taken yet, and would not begin anew.
    replace(_suspended(LOGGER, "logger", 10.0, LOGGED, _SPILLS, *UNNOTICED, noted("log_spilling")), alone=True),
    _process(
        "display-killed", SHOWN, "kill -9 of a display, restarted after 1 s", _SHOWN, harm.kill(DISPLAY), *_UNSEEN
    ),
    _suspended(DISPLAY, "display", 0.05, SHOWN, _SHOWN, *_UNSEEN),
    _suspended(DISPLAY, "display", 1.0, SHOWN, _SHOWN, *_UNSEEN),
    _suspended(DISPLAY, "display", 10.0, SHOWN, _SHOWN, *_UNSEEN),
    _process(
        "display-not-reading",
        SHOWN,
        "a display's connections stay, and nothing is read from them for 10 s",
        _SHOWN,
        harm.hold(DISPLAY, 10.0, 2.0),
        *_UNSEEN,
    ),
)
"""Process cases."""

# --- links, by relays and by pulling real (virtual Ethernet) cables ------------------------------------------------

_ANY = f"the trial goes on, or is {PAUSED}"


def _link(name: str, done: str, expected: str, act: harm.Act, *checks: Check, setup: Setup = RELAYED) -> Case:
    return Case(name, "links", done, expected, setup, act, checks)


def _unreachable(name: str, done: str, act: harm.Act, also: str = "", setup: Setup = RELAYED) -> Case:
    """Return a case in which the left agent is out of reach longer than the timeout, so the trial pauses."""
    expected = f"{LEFT_FALLS}{PAUSED}; {also}{REMEMBERED}"
    return _link(name, done, expected, act, falls("left"), paused(*OUTAGE), rendered_known("left"), setup=setup)


def _briefly_unreachable(name: str, done: str, act: harm.Act, setup: Setup = RELAYED) -> Case:
    """Return a case in which the left agent is out of reach so briefly that the trial may go on."""
    expected = f"the left force begins to fall in time; {_ANY}"
    return _link(name, done, expected, act, falls("left", to_zero=False), either(*OUTAGE), setup=setup)


def _weather(name: str, done: str, expected: str, *checks: Check, up: Weather = FAIR, down: Weather = FAIR) -> Case:
    """Return a case that degrades the left agent's line for 3 s."""
    return _link(name, done, expected, harm.blow(LEFT, up, down), *checks)


def _weather_each_way(name: str, done: str, expected: str, check: Check, weather: Weather) -> Case:
    return _weather(name, done, expected, check, up=weather, down=weather)


LINKS = (
    _briefly_unreachable(
        "line-held-20ms",
        "the link between an agent and the server holds all bytes for 20 ms",
        harm.hold(LEFT, 0.02),
    ),
    _unreachable("line-held-200ms", "the same for 200 ms", harm.hold(LEFT, 0.2)),
    _unreachable("line-held-5s", "the same for 5 s", harm.hold(LEFT, 5.0)),
    _link(
        "lines-held-200ms",
        "the same on the lines of both agents for 200 ms",
        FALLS + PAUSED,
        harm.together(harm.hold(LEFT, 0.2), harm.hold(RIGHT, 0.2)),
        *(falls(*SIDES), paused("agent", "not armed")),
    ),
    _unreachable("line-cut-20ms", "an agent's connections are reset, and new ones for 20 ms", harm.cut(LEFT, 0.02)),
    _unreachable("line-cut-200ms", "the same for 200 ms", harm.cut(LEFT, 0.2)),
    _unreachable("line-cut-5s", "the same for 5 s", harm.cut(LEFT, 5.0)),
    _unreachable(
        "black-hole",
        "an agent's connections are reset; new ones are accepted and swallow everything for 2 s",
        harm.swallow(LEFT, 2.0),
    ),
    _unreachable(
        "doubled",
        "an agent's connections are reset, and made twice for 2 s: the server gets every byte twice",
        harm.double(LEFT),
        "one of the two is accepted; ",
    ),
    _weather_each_way(
        "delay-1ms",
        "1 ms each way on an agent's line for 3 s",
        "the trial goes on",
        goes_on,
        Weather(0.001),
    ),
    _weather_each_way("delay-10ms", "10 ms each way", "the trial goes on", goes_on, Weather(0.01)),
    _weather("delay-20ms-up", "20 ms from agent to server only", _ANY, either(*OUTAGE), up=Weather(0.02)),
    _weather(
        "delay-20ms-down",
        "20 ms from server to agent only",
        f"the left force begins to fall where the delay begins; {_ANY}",
        *(falls("left", to_zero=False), either(*OUTAGE)),
        down=Weather(0.02),
    ),
    _weather_each_way(
        "delay-50ms",
        "50 ms each way",
        f"{PAUSED}; not resumed before it is over",
        paused(*OUTAGE),
        Weather(0.05),
    ),
    _weather_each_way("jitter-20ms", "up to 20 ms each way, at random", _ANY, either(*OUTAGE), Weather(jitter=0.02)),
    _weather_each_way(
        "loss",
        "stalls of 200 ms, as by TCP retransmission, twice a second on average",
        _ANY,
        either(*OUTAGE),
        Weather(stalls=1.0),
    ),
    _weather(
        "throttled",
        "50 kB/s from agent to server, a third of what is sent",
        f"{PAUSED}: samples that had to wait do not count",
        paused(*OUTAGE),
        up=Weather(rate=5e4),
    ),
    _link(
        "clock-unknown",
        "an agent is restarted over a line with 5 ms each way: its clock offset cannot be known to 0.5 ms",
        "its device is not armed, and the server says why, until the line is better",
        harm.distrust(LEFT, Weather(0.005)),
        *(paused("left agent"), told("waiting for", "the left agent's clock")),
        setup=DISTRUSTED,
    ),
    _briefly_unreachable(
        "cable-20ms", "the cable of a station (veth) is pulled for 20 ms", harm.pull_cable(LEFT, 0.02), CABLED
    ),
    _unreachable("cable-200ms", "the same for 200 ms", harm.pull_cable(LEFT, 0.2), setup=CABLED),
    _unreachable("cable-5s", "the same for 5 s", harm.pull_cable(LEFT, 5.0), setup=CABLED),
)
"""Link cases."""

# --- unauthorised peers, devices, clocks and disks ------------------------------------------------------------------

_REFUSED = "refused and recorded; the trial goes on"
_LEFT_RECORDING = (paused("the logger has left"), nothing_lost, told("logger", "exit code 1"), noted("logger_left"))


def _peer(name: str, done: str, expected: str, act: harm.Act, *checks: Check, setup: Setup = DYAD) -> Case:
    return Case(name, "peers", done, expected, setup, act, (goes_on, *checks))


PEERS = (
    _peer(
        "two-agents",
        "a second agent claims a side",
        f"{_REFUSED}; its device is given no force",
        harm.second_agent,
        *(noted("refused", "already has an agent"), told("answer", "already has an agent")),
        told("largest force of the second", "0 N"),
        setup=SINGLE,  # a fifth agent beside two dyads is more than two cores can do in real time
    ),
    _peer(
        "other-version",
        "an agent of another version of the protocol says hello and sends samples",
        _REFUSED,
        harm.say(encode(replace(harm.STRANGER, protocol=PROTOCOL_VERSION + 1)), encode(harm.SAMPLE)),
        *(noted("refused", "speaks protocol"), told("answer", "speaks protocol")),
    ),
    _peer(
        "no-hello",
        "samples without a `Hello`, as from an agent of another session",
        _REFUSED,
        harm.say(encode(harm.SAMPLE)),
        *(noted("refused", "say hello first"), told("answer", "say hello first")),
    ),
    _peer(
        "flood",
        "invalid frames, `Hello` and samples on every channel at full rate, and connections that do not speak ZeroMQ",
        _REFUSED,
        harm.flood,
        *(noted("refused"), told("flood", "frames")),
    ),
)
"""Cases of unauthorised peers."""

DEVICES = (
    Case(
        "emergency-stop",
        "devices",
        "an operator triggers the emergency stop, and releases and resumes 1 s later",
        f"no device has a force until released; {PAUSED} when an operator resumes",
        SINGLE,
        harm.stop_in_an_emergency,
        (paused("emergency stop"), stopped, noted("emergency_stop", "operator"), noted("emergency_release")),
    ),
    Case(
        "device-nan",
        "devices",
        "a device returns NaN positions; then its agent is restarted",
        f"its force is zero at once, and stays so; {PAUSED}",
        DYAD,
        harm.trick_and_restart(LEFT, "nan"),
        (paused(*OUTAGE), powerless("left", to_the_end=True), safeguarded("left", Safeguard.NOT_FINITE)),
        cut="left",
    ),
    Case(
        "device-frozen",
        "devices",
        "a device repeats the same reading for 1 s",
        PAUSED,
        DYAD,
        harm.trick(LEFT, "frozen"),
        (paused(*OUTAGE),),
    ),
    Case(
        "device-jumps",
        "devices",
        "a device's position jumps by 10 cm, and back after 1 s",
        f"too fast: the force goes to zero by the slew limit; {PAUSED}",
        DYAD,
        harm.trick(LEFT, "jump"),
        (paused(*OUTAGE), safeguarded("left", Safeguard.TOO_FAST)),
    ),
    Case(
        "device-gone",
        "devices",
        "a device is unplugged, and plugged in again after 2 s",
        f"the agent tries to set zero force, says so, and leaves until the device is back; {PAUSED}",
        DYAD,
        harm.trick(LEFT, "gone", 2.0),
        (paused(*OUTAGE), powerless("left", to_the_end=False), noted("agent_left", "the device is lost")),
        cut="left",
    ),
)
"""Device cases."""

MACHINES = (
    Case(
        "wall-clock",
        "machines",
        "the wall clock of all processes is set 1 h forward, 2 h back, 10 years forward, and back",
        GOES_ON,
        CLOCKED,
        harm.set_wall_clock(3600, -3600, 315_360_000),
        UNNOTICED,
    ),
    Case(
        "disk-low",
        "machines",
        "the recordings' disk is filled up to 100 MB",
        "the logger has warned, ends the recording and says why; paused; a logger elsewhere goes on, nothing is lost",
        SMALL_DISK,
        harm.fill_disk(100_000_000),
        (*_LEFT_RECORDING, told("warning", "only"), noted("logger_left", "free")),
        alone=True,
    ),
    Case(
        "disk-full",
        "machines",
        "the recordings' disk is filled to the last byte, at once",
        "the same: there is room for the end of the recording",
        SMALL_DISK,
        harm.fill_disk(0),
        _LEFT_RECORDING,
        alone=True,
    ),
    Case(
        "directory-removed",
        "machines",
        "the recordings' folder is deleted with the recording in it",
        "the logger saves what it wrote and says why; paused; a logger elsewhere goes on, nothing is lost",
        SINGLE,
        harm.remove_directory,
        _LEFT_RECORDING,
        alone=True,
    ),
)
"""Clock and disk cases."""
