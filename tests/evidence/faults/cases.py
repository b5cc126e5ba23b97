"""The fault cases: for each the action and the requirement, as text and as code. The attacks are in `attack_cases`.

Requirements after every fault are not repeated in the table: no force step above the slew limit, no vertical force
while a trial is paused, every tick recorded or listed as lost with its cause, no recording that `netboard check` calls
damaged, a running trial at the end, and no effect on another dyad on the same server.
"""

from dataclasses import dataclass, replace
from functools import partial

from evidence.faults import actions
from evidence.faults.actions import Action
from evidence.faults.attackers import SAMPLE
from evidence.faults.checks import (
    Check,
    continues,
    emergency_stopped,
    fact_contains,
    falls,
    frames_shown,
    may_pause,
    neighbour_unaffected,
    no_damage,
    no_force_if_failing,
    no_force_in_pauses,
    nothing_lost,
    paused,
    recorded,
    recovered,
    rendered_known,
    safeguard_reported,
    ticks_accounted,
    within_slew_limit,
)
from evidence.faults.relay import UNIMPAIRED, Impairment
from evidence.faults.sites import Setup
from netboard.base.config import SIDES, Side
from netboard.base.safeguards import Safeguard
from netboard.network.protocol.codec import encode
from netboard.network.protocol.messages import PROTOCOL_VERSION

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
CABLED = Setup("one dyad, real links", namespaces=True)
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
    action: Action
    checks: tuple[Check, ...]
    cut: Side | None = None
    alone: bool = False

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """Return every check of this case."""
        always = (no_force_in_pauses, ticks_accounted, no_damage, recovered, neighbour_unaffected)
        return (*self.checks, within_slew_limit(self.cut), *always)


PARTS = {
    "processes": "Processes killed and stopped",
    "links": "Links cut, slow and lossy",
    "peers": "Unauthorised peers",
    "devices": "Devices that fail",
    "machines": "Clocks and disks",
    "attacks": "Peers that send too much",
}
"""Titles of the tables."""

# Texts and checks that many cases share.

PAUSED = "paused, marked, repeated"
REMEMBERED = "the recording has the force that the device was handed meanwhile"
GOES_ON = "the trial goes on, nothing is lost"
FALLS = "both forces fall in time and are zero in time; "
LEFT_FALLS = "the left force falls in time and is zero in time; "

OUTAGE = ("no sample from the left agent", "not armed", "the left agent")
"""Pause reasons of a trial that has lost an agent."""

_OUTAGE, _PERHAPS_OUTAGE = paused(*OUTAGE), may_pause(*OUTAGE)
CONTINUES: tuple[Check, ...] = (continues, nothing_lost)


def _case(
    part: str,
    name: str,
    setup: Setup,
    done: str,
    expected: str,
    action: Action,
    *checks: Check,
    cut: Side | None = None,
    alone: bool = False,
) -> Case:
    return Case(name, part, done, expected, setup, action, checks, cut, alone)


_process, _device, _machine = (partial(_case, part) for part in ("processes", "devices", "machines"))

# --- processes killed and restarted, or suspended -----------------------------------------------------------------

_ARTICLES = {LEFT: "an", DISPLAY: "a", SERVER: "the", LOGGER: "the"}
_SHOWN = GOES_ON + "; frames are shown again"
_SPILLS = "the trial goes on; the ring spills, and nothing is lost"
_SERVER_STALLED = (paused("stalled"), recorded("stood_still"))
_SHOWN_AGAIN = (*CONTINUES, frames_shown("left"))


def _suspended(process: str, name: str, seconds: float, setup: Setup, expected: str, *checks: Check) -> Case:
    """Return a case that suspends a process for a duration [s]."""
    time = f"{seconds:g} s" if seconds >= 1.0 else f"{seconds * 1e3:g} ms"
    done = f"SIGSTOP of {_ARTICLES[process]} {name} for {time}"
    action = actions.suspend(process, seconds)
    return _process(f"{name}-stopped-{time.replace(' ', '')}", setup, done, expected, action, *checks)


PROCESSES = (
    _process(
        "agent-killed",
        DYAD,
        "kill -9 of an agent, restarted after 1 s",
        PAUSED,
        actions.kill(LEFT),
        *(paused("left agent"), recorded("agent_joined", "left")),
    ),
    _suspended(LEFT, "agent", 0.05, DYAD, f"the trial goes on, or is {PAUSED}", _PERHAPS_OUTAGE),
    *(_suspended(LEFT, "agent", seconds, DYAD, PAUSED, _OUTAGE) for seconds in (1.0, 10.0)),
    _process(
        "server-killed",
        SERVED,
        "kill -9 of the server, restarted after 1 s",
        FALLS + "a new session with a recording of its own; the old one is whole up to its last records",
        actions.kill(SERVER),
        *(falls(*SIDES), recorded("session_started")),
    ),
    _process(
        "other-session",
        SERVED,
        "an agent is suspended while the server is killed and restarted, and resumes in a session that has ended",
        "it gets no force before it has joined the new session; the right force falls in time",
        actions.kill_with_peer_frozen,
        *(falls("right"), recorded("session_started"), recorded("agent_joined", "left")),
    ),
    _suspended(
        *(SERVER, "server", 0.05, SERVED, f"both forces begin to fall in time; {PAUSED}"),
        *(falls(*SIDES, to_zero=False), *_SERVER_STALLED),
    ),
    *(
        _suspended(SERVER, "server", seconds, SERVED, FALLS + PAUSED, falls(*SIDES), *_SERVER_STALLED)
        for seconds in (1.0, 10.0)
    ),
    _process(
        "logger-killed", LOGGED, "kill -9 of the logger, restarted after 1 s", GOES_ON, actions.kill(LOGGER), *CONTINUES
    ),
    _process(
        "logger-away-60s",
        LOGGED,
        "kill -9 of the logger, restarted after 60 s; the ring holds 3 s",
        _SPILLS,
        actions.kill(LOGGER, 60.0, 6.0),
        *(*CONTINUES, recorded("log_spilling"), recorded("logger_joined")),
    ),
    _process(
        "logger-away-unspilled",
        UNSPILLED,
        "the same, with no room to spill to, until 10 s after the server has noticed",
        "paused before anything is lost; what is lost then is listed with its cause",
        actions.kill_logger_until_paused,
        *(fact_contains("notice", "the logger is too far behind"), recorded("log_lost")),
    ),
    *(_suspended(LOGGER, "logger", seconds, LOGGED, GOES_ON, *CONTINUES) for seconds in (0.05, 1.0)),
    # Alone: after other cases the spill may not have been taken yet, and would not begin anew.
    replace(_suspended(LOGGER, "logger", 10.0, LOGGED, _SPILLS, *CONTINUES, recorded("log_spilling")), alone=True),
    _process(
        *("display-killed", SHOWN, "kill -9 of a display, restarted after 1 s", _SHOWN, actions.kill(DISPLAY)),
        *_SHOWN_AGAIN,
    ),
    *(_suspended(DISPLAY, "display", seconds, SHOWN, _SHOWN, *_SHOWN_AGAIN) for seconds in (0.05, 1.0, 10.0)),
    _process(
        "display-not-reading",
        SHOWN,
        "a display's connections stay, and nothing is read from them for 10 s",
        _SHOWN,
        actions.hold(DISPLAY, 10.0, 2.0),
        *_SHOWN_AGAIN,
    ),
)
"""Process cases."""

# --- links, by relays and by pulling real (virtual Ethernet) cables ------------------------------------------------

_ANY = f"the trial goes on, or is {PAUSED}"


def _link(name: str, done: str, expected: str, action: Action, *checks: Check, setup: Setup = RELAYED) -> Case:
    return Case(name, "links", done, expected, setup, action, checks)


def _unreachable(name: str, done: str, action: Action, also: str = "", setup: Setup = RELAYED) -> Case:
    """Return a case in which the left agent is unreachable for longer than the timeout, so the trial pauses."""
    expected = f"{LEFT_FALLS}{PAUSED}; {also}{REMEMBERED}"
    return _link(name, done, expected, action, falls("left"), _OUTAGE, rendered_known("left"), setup=setup)


def _briefly_unreachable(name: str, done: str, action: Action, setup: Setup = RELAYED) -> Case:
    """Return a case in which the left agent is unreachable so briefly that the trial may go on."""
    expected = f"the left force begins to fall in time; {_ANY}"
    return _link(name, done, expected, action, falls("left", to_zero=False), _PERHAPS_OUTAGE, setup=setup)


def _impaired(
    name: str, done: str, expected: str, *checks: Check, up: Impairment = UNIMPAIRED, down: Impairment = UNIMPAIRED
) -> Case:
    """Return a case that degrades the left agent's line for 3 s."""
    return _link(name, done, expected, actions.impair_line(LEFT, up, down), *checks)


def _impaired_each_way(name: str, done: str, expected: str, check: Check, impairment: Impairment) -> Case:
    return _impaired(name, done, expected, check, up=impairment, down=impairment)


LINKS = (
    _briefly_unreachable(
        "line-held-20ms", "the link between an agent and the server holds all bytes for 20 ms", actions.hold(LEFT, 0.02)
    ),
    _unreachable("line-held-200ms", "the same for 200 ms", actions.hold(LEFT, 0.2)),
    _unreachable("line-held-5s", "the same for 5 s", actions.hold(LEFT, 5.0)),
    _link(
        "lines-held-200ms",
        "the same on the lines of both agents for 200 ms",
        FALLS + PAUSED,
        actions.together(actions.hold(LEFT, 0.2), actions.hold(RIGHT, 0.2)),
        *(falls(*SIDES), paused("agent", "not armed")),
    ),
    _unreachable("line-cut-20ms", "an agent's connections are reset, and new ones for 20 ms", actions.cut(LEFT, 0.02)),
    _unreachable("line-cut-200ms", "the same for 200 ms", actions.cut(LEFT, 0.2)),
    _unreachable("line-cut-5s", "the same for 5 s", actions.cut(LEFT, 5.0)),
    _unreachable(
        "black-hole",
        "an agent's connections are reset; new ones are accepted and swallow everything for 2 s",
        actions.black_hole(LEFT, 2.0),
    ),
    _unreachable(
        "doubled",
        "an agent's connections are reset, and made twice for 2 s: the server gets every byte twice",
        actions.duplicate(LEFT),
        "one of the two is accepted; ",
    ),
    _impaired_each_way(
        "delay-1ms", "1 ms each way on an agent's line for 3 s", "the trial goes on", continues, Impairment(0.001)
    ),
    _impaired_each_way("delay-10ms", "10 ms each way", "the trial goes on", continues, Impairment(0.01)),
    _impaired("delay-20ms-up", "20 ms from agent to server only", _ANY, _PERHAPS_OUTAGE, up=Impairment(0.02)),
    _impaired(
        "delay-20ms-down",
        "20 ms from server to agent only",
        f"the left force begins to fall where the delay begins; {_ANY}",
        *(falls("left", to_zero=False), _PERHAPS_OUTAGE),
        down=Impairment(0.02),
    ),
    _impaired_each_way(
        "delay-50ms", "50 ms each way", f"{PAUSED}; not resumed before it is over", _OUTAGE, Impairment(0.05)
    ),
    _impaired_each_way(
        "jitter-20ms", "up to 20 ms each way, at random", _ANY, _PERHAPS_OUTAGE, Impairment(jitter=0.02)
    ),
    _impaired_each_way(
        "loss",
        "stalls of 200 ms, as by TCP retransmission, twice a second on average",
        _ANY,
        _PERHAPS_OUTAGE,
        Impairment(stalls=1.0),
    ),
    _impaired(
        "throttled",
        "50 kB/s from agent to server, a third of what is sent",
        f"{PAUSED}: samples that had to wait do not count",
        _OUTAGE,
        up=Impairment(rate=5e4),
    ),
    _link(
        "clock-unknown",
        "an agent is restarted over a line with 5 ms each way: its clock offset cannot be known to 0.5 ms",
        "its device is not armed, and the server says why, until the line is better",
        actions.restart_with_unknown_clock(LEFT, Impairment(0.005)),
        *(paused("left agent"), fact_contains("waiting for", "the left agent's clock")),
        setup=DISTRUSTED,
    ),
    _briefly_unreachable(
        "cable-20ms", "the cable of a station (veth) is pulled for 20 ms", actions.pull_cable(LEFT, 0.02), CABLED
    ),
    _unreachable("cable-200ms", "the same for 200 ms", actions.pull_cable(LEFT, 0.2), setup=CABLED),
    _unreachable("cable-5s", "the same for 5 s", actions.pull_cable(LEFT, 5.0), setup=CABLED),
)
"""Link cases."""

# --- unauthorised peers, devices, clocks and disks ------------------------------------------------------------------

_REFUSED = "refused and recorded; the trial goes on"
_LOGGER_LEFT = (
    *(paused("the logger has left"), nothing_lost, fact_contains("logger", "exit code 1"), recorded("logger_left")),
)


def _peer(name: str, done: str, expected: str, action: Action, *checks: Check, setup: Setup = DYAD) -> Case:
    return Case(name, "peers", done, expected, setup, action, (continues, *checks))


PEERS = (
    _peer(
        "two-agents",
        "a second agent claims a side",
        f"{_REFUSED}; its device is given no force",
        actions.second_agent,
        *(recorded("refused", "already has an agent"), fact_contains("answer", "already has an agent")),
        fact_contains("largest force of the second", "0 N"),
        setup=SINGLE,  # a fifth agent beside two dyads is more than two cores can do in real time
    ),
    _peer(
        "other-version",
        "an agent of another version of the protocol says hello and sends samples",
        _REFUSED,
        actions.send_as_stranger(encode(replace(actions.STRANGER, protocol=PROTOCOL_VERSION + 1)), encode(SAMPLE)),
        *(recorded("refused", "speaks protocol"), fact_contains("answer", "speaks protocol")),
    ),
    _peer(
        "no-hello",
        "samples without a `Hello`, as from an agent of another session",
        _REFUSED,
        actions.send_as_stranger(encode(SAMPLE)),
        *(
            recorded("refused", "it has not joined yet"),
            fact_contains("answer", "it has not joined yet"),
        ),
    ),
    _peer(
        "flood",
        "invalid frames, `Hello` and samples on every channel at full rate, and connections that do not speak ZeroMQ",
        _REFUSED,
        actions.flood,
        *(recorded("refused"), fact_contains("flood", "frames")),
    ),
)
"""Cases of unauthorised peers."""

DEVICES = (
    _device(
        "emergency-stop",
        SINGLE,
        "an operator triggers the emergency stop, and releases and resumes 1 s later",
        f"no device has a force until released; {PAUSED} when an operator resumes",
        actions.emergency_stop,
        *(
            paused("emergency stop"),
            emergency_stopped,
            recorded("emergency_stop", "operator"),
            recorded("emergency_release"),
        ),
    ),
    _device(
        "device-nan",
        DYAD,
        "a device returns NaN positions; then its agent is restarted",
        f"its force is zero at once, and stays so; {PAUSED}",
        actions.fail_device_and_restart(LEFT, "nan"),
        *(_OUTAGE, no_force_if_failing("left", to_the_end=True), safeguard_reported("left", Safeguard.NOT_FINITE)),
        cut="left",
    ),
    _device(
        "device-frozen",
        DYAD,
        "a device repeats the same reading for 1 s",
        PAUSED,
        actions.fail_device(LEFT, "frozen"),
        _OUTAGE,
    ),
    _device(
        "device-jumps",
        DYAD,
        "a device's position jumps by 10 cm, and back after 1 s",
        f"too fast: the force goes to zero by the slew limit; {PAUSED}",
        actions.fail_device(LEFT, "jump"),
        *(_OUTAGE, safeguard_reported("left", Safeguard.TOO_FAST)),
    ),
    _device(
        "device-gone",
        DYAD,
        "a device is unplugged, and plugged in again after 2 s",
        f"the agent tries to set zero force, says so, and leaves until the device is back; {PAUSED}",
        actions.fail_device(LEFT, "gone", 2.0),
        *(_OUTAGE, no_force_if_failing("left", to_the_end=False), recorded("agent_left", "the device is lost")),
        cut="left",
    ),
)
"""Device cases."""

MACHINES = (
    _machine(
        "wall-clock",
        CLOCKED,
        "the wall clock of all processes is set 1 h forward, 2 h back, 10 years forward, and back",
        GOES_ON,
        actions.set_wall_clock(3600, -3600, 315_360_000),
        *CONTINUES,
    ),
    _machine(
        "disk-low",
        SMALL_DISK,
        "the recordings' disk is filled up to 100 MB",
        "the logger has warned, ends the recording and says why; paused; a logger elsewhere goes on, nothing is lost",
        actions.fill_disk(100_000_000),
        *(*_LOGGER_LEFT, fact_contains("warning", "only"), recorded("logger_left", "free")),
        alone=True,
    ),
    _machine(
        "disk-full",
        SMALL_DISK,
        "the recordings' disk is filled to the last byte, at once",
        "the same: there is room for the end of the recording",
        actions.fill_disk(0),
        *_LOGGER_LEFT,
        alone=True,
    ),
    _machine(
        "directory-removed",
        SINGLE,
        "the recordings' folder is deleted with the recording in it",
        "the logger saves what it wrote and says why; paused; a logger elsewhere goes on, nothing is lost",
        actions.remove_directory,
        *_LOGGER_LEFT,
        alone=True,
    ),
)
"""Clock and disk cases."""
