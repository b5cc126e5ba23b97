"""Configuration tables of the rig: network, real time, safety, devices, displays, recordings.

`netboard.base.config` reads the tables and gives the common rules.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import BeforeValidator, StrictBool

from netboard.base.settings import FORBID_UNKNOWN_KEYS, TextForm, about

VIEW_REPEAT_MS = 50
"""Time after which the server sends an unchanged view again, so that a display knows that the link is alive [ms]."""

MOUSE = "mouse"
"""Device backend of a side that a person plays in the display's window."""

WITHOUT_FORCE = (MOUSE, "spacemouse")
"""Device backends that render no force."""

CPU_LIST = TextForm(
    "^(auto|([0-9]{1,4}(-[0-9]{1,4})?(,[0-9]{1,4}(-[0-9]{1,4})?)*)?)$",
    "with numbers and ranges of CPUs, such as 2 or 0,2-3, or auto",
)
"""Form of a list of CPUs."""


@dataclass(frozen=True, slots=True)
class Network:
    """Where the server listens, and how peers are watched."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    host: Annotated[str, about("address of the physics server for its peers", min_length=1)] = "127.0.0.1"
    bind: Annotated[str, about("address the server binds to", min_length=1)] = "127.0.0.1"
    port: Annotated[int, about("first of the six TCP ports in use", "1", ge=1024, le=65_000)] = 5550
    transport: Annotated[
        Literal["tcp", "ipc"], about("tcp, or sockets of this machine's file system, named after the port")
    ] = "tcp"
    curve: Annotated[
        Literal["auto", "on", "off"], about("encryption and keys; auto: on where other machines can reach the server")
    ] = "auto"
    keys: Annotated[str, about("folder of this machine's keys (netboard keys)", min_length=1)] = "keys"
    sample_timeout_ms: Annotated[
        float, about("a stylus sample older than this pauses the trial", "ms", gt=0, le=10_000)
    ] = 50.0
    clock_bound_ms: Annotated[
        float, about("a device is armed only while its clock is known to this bound", "ms", gt=0, le=1000)
    ] = 0.5
    delay_action: Annotated[
        Literal["warn", "soften", "disarm"],
        about("action if the delay exceeds half of the largest stable one: warn, reduce the force, pause the trial"),
    ] = "warn"
    view_rate_hz: Annotated[float, about("highest rate of views sent to a display", "Hz", gt=0, le=1000)] = 120.0
    log_ring_s: Annotated[
        float,
        about("duration of records that the server keeps in memory for a logger that joins late", "s", ge=1, le=3600),
    ] = 120.0
    log_spill_mb: Annotated[
        float,
        about(
            "size limit of the spill file, for records that leave the ring buffer before a logger has written them",
            "MB",
            ge=0,
            le=1e6,
        ),
    ] = 4000.0
    require_logger: Annotated[StrictBool, about("true: a block starts only while a logger records")] = True


@dataclass(frozen=True, slots=True)
class Stations:
    """Machines of the stations. On one that is not the server's, netboard station starts agent and display."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    left: Annotated[str, about("address of the left station's machine; empty: it is the server's")] = ""
    right: Annotated[str, about("address of the right station's machine, likewise")] = ""
    port: Annotated[
        int,
        about("TCP port of netboard station at the left station; at the right one the next", "1", ge=1024, le=65_000),
    ] = 5560

    def of(self, side: Literal["left", "right"]) -> str:
        """Return the address of a station's machine; empty if it is the server's."""
        return self.left if side == "left" else self.right

    def port_of(self, side: Literal["left", "right"]) -> int:
        """Return the port of the service at a station [1]."""
        return self.port + (side == "right")


@dataclass(frozen=True, slots=True)
class Realtime:
    """Real-time resources that each process requests. If one is refused, the process logs it and continues without."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    scheduling: Annotated[StrictBool, about("true: real-time scheduling (SCHED_FIFO) of the 1 kHz loops")] = True
    lock_memory: Annotated[StrictBool, about("true: keep the processes' memory from being paged out")] = True
    server_cpus: Annotated[str, about("CPUs of the server; auto: one; empty: any", form=CPU_LIST)] = "auto"
    agent_cpus: Annotated[
        str, about("CPUs of the agents, likewise; auto: one each, where there are enough", form=CPU_LIST)
    ] = "auto"


@dataclass(frozen=True, slots=True)
class Safety:
    """Limits that the agent enforces at the motor, whatever force is commanded."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    max_force: Annotated[float, about("largest force at the stylus (norm)", "N", gt=0, le=40)] = 3.0
    mean_force: Annotated[
        float,
        about("largest mean force over about 10 s; a device's own rating applies if it is smaller", "N", gt=0, le=40),
    ] = 0.88
    max_slew: Annotated[float, about("largest change of force", "N/s", gt=0, le=10_000)] = 500.0
    max_speed: Annotated[float, about("stylus speed above which the force is cut", "m/s", gt=0, le=10)] = 1.0
    # With the period of the agent's loop at most 10 ms; two intervals between heartbeats are 8 ms.
    stale_after_ms: Annotated[
        float, about("age of the last commanded force at which it begins to fade", "ms", gt=0, le=1000)
    ] = 9.0
    fade_ms: Annotated[float, about("time a stale force takes to fade to zero", "ms", gt=0, le=1000)] = 50.0
    disarm_after_ms: Annotated[
        float, about("age of the last force at which the device is disarmed", "ms", gt=0, le=10_000)
    ] = 100.0
    hold_damping: Annotated[float, about("damping while a stale force fades", "N s/m", ge=0, le=5)] = 1.0
    arm_time: Annotated[float, about("ramp from no force to full force after arming", "s", gt=0, le=10)] = 1.0
    arm_gate: Annotated[float, about("arming waits until the commanded force is below this", "N", gt=0, le=5)] = 0.2
    passivity: Annotated[StrictBool, about("true: passivity control, so that delayed forces generate no energy")] = (
        False
    )


@dataclass(frozen=True, slots=True)
class Fixture:
    """The lateral constraint: the agent holds the stylus on the vertical line x = y = 0, in all blocks."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    stiffness: Annotated[float, about("stiffness towards x = y = 0", "N/m", ge=0, le=2000)] = 400.0
    damping: Annotated[float, about("damping of x and y", "N s/m", ge=0, le=20)] = 4.0


MOST_BUTTONS = 2**32 - 1
"""Mask of 32 buttons, the most that a device reports; the registry of devices has the limit of each backend [1]."""


@dataclass(frozen=True, slots=True)
class Agent:
    """One device and the agent that owns it."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    device: Annotated[
        str, about("device backend, of those that `netboard devices list` names: openhaptics, mouse, ...", min_length=1)
    ] = "virtual"
    zero: Annotated[float, about("height of the device's own origin that is the scene's z = 0", "m", ge=-1, le=1)] = 0.0
    stop_buttons: Annotated[
        int, about("sum of the bits of buttons that are an emergency stop", "1", ge=0, le=MOST_BUTTONS)
    ] = 0
    consent_buttons: Annotated[
        int, about("sum of the bits of buttons that must be held down for a force; 0: none", "1", ge=0, le=MOST_BUTTONS)
    ] = 0
    velocity: Annotated[
        Literal["device", "adaptive", "chai3d", "difference", "alpha_beta", "kalman"],
        about("source of the stylus velocity: the device or its driver, or an estimator that uses the positions"),
    ] = "device"
    options: Annotated[dict[str, str | int | float | bool], about("options of the device backend")] = field(
        default_factory=dict
    )


@dataclass(frozen=True, slots=True)
class Agents:
    """The two agents."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    profiles: Annotated[
        str, about("folder of the profiles of devices, which are named after serial numbers", min_length=1)
    ] = "profiles"
    left: Agent = field(default_factory=Agent)
    right: Agent = field(default_factory=Agent)

    def of(self, side: Literal["left", "right"]) -> Agent:
        """Return the agent of a side.

        Parameters
        ----------
        side : {"left", "right"}
            End of the board that the agent's device moves.
        """
        return self.left if side == "left" else self.right


Options = dict[str, str | int | float | bool]


@dataclass(frozen=True, slots=True)
class Partners:
    """Parameters of the robot partners at both sides, in place of their defaults."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    left: Annotated[Options, about("parameters of the robot partner at the left side")] = field(default_factory=dict)
    right: Annotated[Options, about("parameters of the robot partner at the right side")] = field(default_factory=dict)

    def of(self, side: Literal["left", "right"]) -> Options:
        """Return the parameters of a side.

        Parameters
        ----------
        side : {"left", "right"}
            End of the board that the partner moves.
        """
        return self.left if side == "left" else self.right


def _was_a_flag(value: object) -> object:
    """Return a value of `Display.fullscreen`: older recordings and rigs have true or false."""
    return ("never", "always")[value] if isinstance(value, bool) else value


@dataclass(frozen=True, slots=True)
class Display:
    """The participants' windows."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    width: Annotated[int, about("window width in pixels", "1", ge=200, le=20_000)] = 1200
    height: Annotated[int, about("window height in pixels", "1", ge=150, le=20_000)] = 700
    fullscreen: Annotated[
        Literal["auto", "always", "never"],
        BeforeValidator(_was_a_flag),
        about('full screen, without a frame; "auto": if the two stations are different machines'),
    ] = "auto"
    ball: Annotated[
        Literal["rolling", "plain"],
        about('"rolling": a stripe shows how the ball rolls; "plain": a disc, as in the paper'),
    ] = "rolling"
    screen: Annotated[int, about("number of the screen the window opens on; 0: the main one", "1", ge=0, le=15)] = 0
    mm_per_pixel: Annotated[
        float, about("size of a pixel, so that the board has its true size; 0: it fills the window", "mm", ge=0, le=10)
    ] = 0.0
    language: Annotated[str, about("en, de, fr, es, it, or a TOML file with the texts", min_length=1)] = "en"
    smooth: Annotated[StrictBool, about("true: motion is extrapolated to every screen refresh")] = True
    patch: Annotated[StrictBool, about("true: a patch in the corner, for a photodiode, is white in a trial")] = False
    markers: Annotated[
        str, about("where trial events are marked as they are painted: none, lsl, or a serial port such as /dev/ttyS0")
    ] = "none"
    link_timeout_ms: Annotated[
        float,
        about(
            f"the window blanks after this time without a view; an unchanged one comes every {VIEW_REPEAT_MS} ms",
            "ms",
            gt=0,
            le=60_000,
        ),
    ] = 500.0


@dataclass(frozen=True, slots=True)
class RecordingSettings:
    """Where and how the logger writes."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    directory: Annotated[str, about("folder of the recordings", min_length=1)] = "recordings"
    flush_ms: Annotated[float, about("a chunk is written and synced at least this often", "ms", gt=0, le=5000)] = 400.0
    chunk_bytes: Annotated[
        int, about("a chunk is written when it grows to this size, in bytes", "1", ge=1024, le=2**24)
    ] = 393_216
