"""Faults of unauthorised peers, of devices, of clocks and of disks."""

from dataclasses import replace

from netboard.benchmarks.faults.case import (
    CLOCKED,
    DYAD,
    GOES_ON,
    LEFT,
    OUTAGE,
    PAUSED,
    SINGLE,
    SMALL_DISK,
    UNNOTICED,
    Case,
)
from netboard.benchmarks.faults.checks import (
    Check,
    goes_on,
    noted,
    nothing_lost,
    paused,
    powerless,
    safeguarded,
    stopped,
    told,
)
from netboard.benchmarks.faults.harm import (
    SAMPLE,
    STRANGER,
    Act,
    fill_disk,
    flood,
    remove_directory,
    say,
    second_agent,
    set_wall_clock,
    stop_in_an_emergency,
    trick,
    trick_and_restart,
)
from netboard.benchmarks.faults.sites import Setup
from netboard.network.protocol.codec import encode
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.motion import Safeguard

_REFUSED = "refused and recorded; the trial goes on"
_LEFT_RECORDING = (paused("the logger has left"), nothing_lost, told("logger", "exit code 1"), noted("logger_left"))


def _peer(name: str, done: str, expected: str, act: Act, *checks: Check, setup: Setup = DYAD) -> Case:
    return Case(name, "peers", done, expected, setup, act, (goes_on, *checks))


PEERS = (
    _peer(
        "two-agents",
        "a second agent claims a side",
        f"{_REFUSED}; its device is given no force",
        second_agent,
        *(noted("refused", "already has an agent"), told("answer", "already has an agent")),
        told("largest force of the second", "0 N"),
        setup=SINGLE,  # a fifth agent beside two dyads is more than two cores can do in real time
    ),
    _peer(
        "other-version",
        "an agent of another version of the protocol says hello and sends samples",
        _REFUSED,
        say(encode(replace(STRANGER, protocol=PROTOCOL_VERSION + 1)), encode(SAMPLE)),
        *(noted("refused", "speaks protocol"), told("answer", "speaks protocol")),
    ),
    _peer(
        "no-hello",
        "samples without a `Hello`, as from an agent of another session",
        _REFUSED,
        say(encode(SAMPLE)),
        *(noted("refused", "say hello first"), told("answer", "say hello first")),
    ),
    _peer(
        "flood",
        "invalid frames, `Hello` and samples on every channel at full rate, and connections that do not speak ZeroMQ",
        _REFUSED,
        flood,
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
        stop_in_an_emergency,
        (paused("emergency stop"), stopped, noted("emergency_stop", "operator"), noted("emergency_release")),
    ),
    Case(
        "device-nan",
        "devices",
        "a device returns NaN positions; then its agent is restarted",
        f"its force is zero at once, and stays so; {PAUSED}",
        DYAD,
        trick_and_restart(LEFT, "nan"),
        (paused(*OUTAGE), powerless("left", to_the_end=True), safeguarded("left", Safeguard.NOT_FINITE)),
        cut="left",
    ),
    Case(
        "device-frozen",
        "devices",
        "a device repeats the same reading for 1 s",
        PAUSED,
        DYAD,
        trick(LEFT, "frozen"),
        (paused(*OUTAGE),),
    ),
    Case(
        "device-jumps",
        "devices",
        "a device's position jumps by 10 cm, and back after 1 s",
        f"too fast: the force goes to zero by the slew limit; {PAUSED}",
        DYAD,
        trick(LEFT, "jump"),
        (paused(*OUTAGE), safeguarded("left", Safeguard.TOO_FAST)),
    ),
    Case(
        "device-gone",
        "devices",
        "a device is unplugged, and plugged in again after 2 s",
        f"the agent tries to set zero force, says so, and leaves until the device is back; {PAUSED}",
        DYAD,
        trick(LEFT, "gone", 2.0),
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
        set_wall_clock(3600, -3600, 315_360_000),
        UNNOTICED,
    ),
    Case(
        "disk-low",
        "machines",
        "the recordings' disk is filled up to 100 MB",
        "the logger has warned, ends the recording and says why; paused; a logger elsewhere goes on, nothing is lost",
        SMALL_DISK,
        fill_disk(100_000_000),
        (*_LEFT_RECORDING, told("warning", "only"), noted("logger_left", "free")),
        alone=True,
    ),
    Case(
        "disk-full",
        "machines",
        "the recordings' disk is filled to the last byte, at once",
        "the same: there is room for the end of the recording",
        SMALL_DISK,
        fill_disk(0),
        _LEFT_RECORDING,
        alone=True,
    ),
    Case(
        "directory-removed",
        "machines",
        "the recordings' folder is deleted with the recording in it",
        "the logger saves what it wrote and says why; paused; a logger elsewhere goes on, nothing is lost",
        SINGLE,
        remove_directory,
        _LEFT_RECORDING,
        alone=True,
    ),
)
"""Clock and disk cases."""
