"""The configuration: one TOML text for rig and experiment, checked and turned into frozen dataclasses.

Every default is the paper's. Every quantity is in SI units and says so in its metadata, from which error messages, the
commented template of ``netboard config init`` and the documentation are made. An unknown key, a wrong type or a value
out of range is a `ConfigError` that names source, table and key and says what was expected.

This module parses text; it opens no file (the services do), so the pure part may import the dataclasses.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import StrictBool, StrictInt, TypeAdapter

from netboard.errors import ConfigError
from netboard.settings import NO_EXTRAS, about, read, write, write_template

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
OfModel = Literal["model"]

MOST_TRIALS = 10_000
"""A block has at most so many trials [1]."""

MOUSE = "mouse"
"""Device backend of a side that a person plays in the display's window."""

TEMPLATE_HEAD = """\
# netboard: one rig and one experiment.
# Every key is here with its default, which is the paper's. A key left out takes its default;
# an unknown one is an error.
# Check this file with: netboard config check

"""


@dataclass(frozen=True, slots=True)
class Session:
    """Who takes part, and how the session is labelled."""

    __pydantic_config__ = NO_EXTRAS
    name: Annotated[str, about("label of the session, part of the recording's name", pattern=r"^[A-Za-z0-9_-]+$")] = (
        "S01"
    )
    dyad: Annotated[str, about("pseudonymous id of the dyad", pattern=r"^[A-Za-z0-9_-]+$")] = "D01"
    pilot: Annotated[StrictBool, about("true: a pilot run, marked as such in the data")] = False
    study: Annotated[str, about("name of the study; empty: none, a single block")] = ""
    participant_a: Annotated[str, about("pseudonymous id of participant A", pattern=r"^[A-Za-z0-9_-]+$")] = "A"
    participant_b: Annotated[str, about("pseudonymous id of participant B", pattern=r"^[A-Za-z0-9_-]+$")] = "B"
    hand_a: Annotated[Literal["right", "left"], about("dominant hand of participant A")] = "right"
    hand_b: Annotated[Literal["right", "left"], about("dominant hand of participant B")] = "right"
    seat_a: Annotated[Literal["left", "right"], about("where participant A sits; B sits at the other side")] = "left"
    consent: Annotated[StrictBool, about("true: both participants have given their consent")] = False

    @property
    def ready(self) -> bool:
        """Whether a block of a study may begin: with consent, or as a pilot run."""
        return self.consent or self.pilot


@dataclass(frozen=True, slots=True)
class Physics:
    """The virtual board and ball, in the paper's symbols (its Table I)."""

    __pydantic_config__ = NO_EXTRAS
    M: Annotated[float, about("mass of the board", "kg", gt=0, le=10)] = 0.01
    m: Annotated[float, about("mass of the ball", "kg", gt=0, le=10)] = 0.05
    g: Annotated[float, about("gravitational acceleration", "m/s2", ge=0, le=30)] = 9.81
    k_h: Annotated[float, about("stiffness of the coupling between stylus and board", "N/m", ge=0, le=10_000)] = 200.0
    c_h: Annotated[float, about("damping of the coupling between stylus and board", "N s/m", ge=0, le=100)] = 2.0
    k_s: Annotated[float, about("stiffness of the spring from board centre to origin", "N/m", ge=0, le=10_000)] = 140.0
    l: Annotated[float, about("control point to board centre", "m", gt=0, le=2)] = 0.25  # noqa: E741
    I: Annotated[float, about("moment of inertia of the board", "kg m2", gt=0, le=10)] = 0.0004  # noqa: E741
    ball_sign: Annotated[
        Literal["downhill", "printed"],
        about("sign of the ball's equation: downhill (-g sin theta) or as printed in the paper (+)"),
    ] = "downhill"
    fixed_ball: Annotated[
        Literal["loads_board", "carried"],
        about("a fixed ball's weight loads the board, or is carried by the fixture (a force step at release)"),
    ] = "loads_board"
    model: Annotated[
        Literal["paper", "lagrangian"],
        about("the paper's equations, or those of Lagrange for the same scene: with the ball's inertia on the board"),
    ] = "paper"
    board: Annotated[
        Literal["free", "hinged", "level"],
        about("free: it heaves and tilts; hinged: it tilts about its fixed centre; level: it heaves and cannot tilt"),
    ] = "free"
    coupling: Annotated[Literal["both", "left", "right", "none"], about("which hands are coupled to the board")] = (
        "both"
    )
    coupling_at: Annotated[
        Literal["server", "both"],
        about("where a hand's force is computed: on the server, or, for long delays, in both server and agent"),
    ] = "server"
    balls: Annotated[int, about("how many balls, each of mass m; they pass each other", ge=0, le=4)] = 1
    ball_inertia: Annotated[
        float,
        about("moment of inertia of a ball over m r2: 0 slides, 0.4 rolls (solid sphere), 0.667 (hollow)", ge=0, le=1),
    ] = 0.0
    ball_height: Annotated[
        float, about("height of a ball's centre above the board, in the lagrangian model", "m", ge=0, le=0.2)
    ] = 0.0
    ball_stop: Annotated[
        float, about("where stops turn a ball back, from the board's centre; 0: there are none", "m", ge=0, le=2)
    ] = 0.0
    restitution: Annotated[float, about("share of its speed that a stop gives back to a ball", ge=0, le=1)] = 0.0
    b_z: Annotated[float, about("damping of the board's heave", "N s/m", ge=0, le=100)] = 0.0
    b_theta: Annotated[float, about("damping of the board's tilt", "N m s/rad", ge=0, le=100)] = 0.0
    hold: Annotated[
        Literal["zoh", "cv", "ca"],
        about("how a stylus moves after its last sample: not at all, with its velocity, or with its acceleration too"),
    ] = "ca"
    method: Annotated[
        Literal[
            "auto",
            "euler",
            "semi_implicit",
            "heun",
            "verlet",
            "midpoint",
            "rk4",
            "etd2rk",
            "etdrk4",
            "dop853",
            "exact",
        ],
        about("how the board is stepped; auto: whatever holds the scene, rk4 if it does; exact: for a level board"),
    ] = "auto"
    substeps: Annotated[int, about("steps in a tick; 0: as many as the scene needs", ge=0, le=1000)] = 0


@dataclass(frozen=True, slots=True)
class Geometry:
    """Sizes that are drawn and that end a trial."""

    __pydantic_config__ = NO_EXTRAS
    board_length: Annotated[float, about("length of the board", "m", gt=0, le=5)] = 0.700
    board_thickness: Annotated[float, about("height of the board as drawn", "m", gt=0, le=1)] = 0.050
    ball_radius: Annotated[float, about("radius of the ball as drawn", "m", gt=0, le=1)] = 0.025
    target_distance: Annotated[float, about("target centre to board centre", "m", gt=0, le=2)] = 0.150
    target_width: Annotated[float, about("width of the target", "m", gt=0, le=1)] = 0.070


@dataclass(frozen=True, slots=True)
class Task:
    """The rules of a trial (readings B1-B7 of the paper are the defaults)."""

    __pydantic_config__ = NO_EXTRAS
    hold_time: Annotated[float, about("time the ball must stay in the target", "s", gt=0, le=60)] = 1.5
    level_angle_deg: Annotated[float, about("tilt below which the board counts as level", "deg", gt=0, le=45)] = 1.0
    level_rate_deg_s: Annotated[
        float, about("rotation below which the board counts as level", "deg/s", gt=0, le=360)
    ] = 1.0
    level_height: Annotated[
        float, about("height of the board centre within which it counts as level", "m", gt=0, le=1)
    ] = 0.010
    level_time: Annotated[
        float, about("time the board must be level before the ball is released", "s", ge=0, le=60)
    ] = 0.5
    fall_distance: Annotated[float, about("ball centre beyond which it has fallen off", "m", gt=0, le=5)] = 0.350
    time_limit: Annotated[float, about("a trial running longer has failed; 0 for no limit", "s", ge=0, le=3600)] = 0.0
    stylus_range: Annotated[float, about("stylus heights are clipped to +- this", "m", gt=0, le=1)] = 0.075


@dataclass(frozen=True, slots=True)
class Block:
    """One block: trials under one condition; a plan has many."""

    __pydantic_config__ = NO_EXTRAS
    number: Annotated[int, about("number of the block in its plan", "1", ge=1, le=1000)] = 1
    blocks: Annotated[int, about("how many blocks the plan has", "1", ge=1, le=1000)] = 1
    label: Annotated[str, about("what people call the block; empty: its condition")] = ""
    configuration: Annotated[
        Literal["dyadic", "bimanual"], about("two people with one hand each, or one person with both hands")
    ] = "dyadic"
    performer: Annotated[Literal["A", "B"], about("the participant who performs a bimanual block")] = "A"
    station: Annotated[Literal["left", "right"], about("the seat whose display a bimanual block is shown at")] = "left"
    force: Annotated[
        Literal["full", "partner_only", "environment_only", "none", "unrelated"],
        about("what the hands feel: all of the board, only what the partner does, all but that, nothing, or a record"),
    ] = "full"
    force_scale: Annotated[float, about("what is felt is multiplied by this", "1", ge=0, le=2)] = 1.0
    force_delay_ms: Annotated[int, about("what is felt comes so much later", "ms", ge=0, le=500)] = 0
    catch: Annotated[
        tuple[StrictInt, ...],
        about("catch trials: the numbers of those in which nothing is felt", max_length=1000, strict=False),
    ] = ()
    unrelated: Annotated[str, about('recording whose forces are felt with force = "unrelated"')] = ""
    left: Annotated[
        Literal["person", "still", "robot"],
        about("who moves the left hand: a person, nobody (it is held still at height 0), or a simulated partner"),
    ] = "person"
    right: Annotated[Literal["person", "still", "robot"], about("who moves the right hand, likewise")] = "person"
    trials: Annotated[int, about("successful trials in the block", "1", ge=1, le=MOST_TRIALS)] = 60
    duration: Annotated[
        float, about("no trial begins after so long; 0: only the number of trials counts", "s", ge=0, le=36_000)
    ] = 0.0
    first_target: Annotated[Literal["left", "right", "random"], about("side of the first target")] = "random"
    rest: Annotated[float, about("rest before the block", "s", ge=0, le=3600)] = 0.0
    instructions: Annotated[str, about("what the participants read before the block; empty: the standard text")] = ""
    questionnaires: Annotated[str, about("what the operator is to ask after the block, in words; empty: nothing")] = ""
    seed: Annotated[int, about("seed of everything random in the session", "1", ge=0, lt=2**31)] = 1

    @property
    def haptics(self) -> bool:
        """Whether the hands feel anything."""
        return self.force != "none"


@dataclass(frozen=True, slots=True)
class Quality:
    """What makes a trial doubtful: rules that are declared before, and applied by code."""

    __pydantic_config__ = NO_EXTRAS
    late_ticks: Annotated[int, about("most ticks of a trial that may be late", "1", ge=0, le=1_000_000)] = 20
    lost_share: Annotated[float, about("largest share of a trial without a fresh sample", "1", ge=0, le=1)] = 0.02
    clipped_share: Annotated[float, about("largest share with a force at its limit", "1", ge=0, le=1)] = 0.05
    saturated_share: Annotated[
        float, about("largest share with a stylus at the edge of its range", "1", ge=0, le=1)
    ] = 0.05
    start_tilt_deg: Annotated[float, about("largest tilt at the release", "deg", gt=0, le=90)] = 1.5
    stuck: Annotated[
        float, about("longest time for which the height of a stylus may not change at all", "s", gt=0, le=60)
    ] = 2.0
    shortest: Annotated[float, about("a completion time below this is too short", "s", ge=0, le=60)] = 0.3
    longest: Annotated[float, about("a completion time above this is too long", "s", gt=0, le=3600)] = 60.0
    frozen_ms: Annotated[
        float, about("longest time between two frames of a display while the board moves", "ms", gt=0, le=60_000)
    ] = 250.0
    repeat: Annotated[
        Literal["none", "flagged"], about("flagged: a doubtful trial is repeated at the end of its block")
    ] = "none"


@dataclass(frozen=True, slots=True)
class Network:
    """Where the server listens, and how peers are watched."""

    __pydantic_config__ = NO_EXTRAS
    host: Annotated[str, about("address of the physics server as the peers see it", min_length=1)] = "127.0.0.1"
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
        about("a hand's loop takes more than half of what is stable: say so, soften what is felt, or pause the trial"),
    ] = "warn"
    view_rate_hz: Annotated[float, about("highest rate of views sent to a display", "Hz", gt=0, le=1000)] = 120.0
    log_ring_s: Annotated[float, about("seconds of records the server keeps for a late logger", "s", ge=1, le=3600)] = (
        120.0
    )
    log_spill_mb: Annotated[
        float, about("records that leave the ring unwritten go to a file of at most this size", "MB", ge=0, le=1e6)
    ] = 4000.0
    require_logger: Annotated[StrictBool, about("true: a block starts only while a logger records")] = True


@dataclass(frozen=True, slots=True)
class Realtime:
    """What each process asks its machine for; what is refused is said, and the process goes on without it."""

    __pydantic_config__ = NO_EXTRAS
    scheduling: Annotated[StrictBool, about("true: real-time scheduling (SCHED_FIFO) of the 1 kHz loops")] = True
    lock_memory: Annotated[StrictBool, about("true: keep the processes' memory from being paged out")] = True
    server_cpus: Annotated[
        str, about("CPUs of the server, such as 2 or 0,2-3; auto: one; empty: any", pattern=r"^(auto|[0-9,-]*)$")
    ] = "auto"
    agent_cpus: Annotated[
        str, about("CPUs of the agents, likewise; auto: one each, where there are enough", pattern=r"^(auto|[0-9,-]*)$")
    ] = "auto"


@dataclass(frozen=True, slots=True)
class Safety:
    """Limits the agent enforces next to the motor, whatever it is told."""

    __pydantic_config__ = NO_EXTRAS
    max_force: Annotated[float, about("largest force at the stylus (norm)", "N", gt=0, le=40)] = 3.0
    mean_force: Annotated[
        float,
        about("largest mean force over some 10 s; a device's own rating counts where it is less", "N", gt=0, le=40),
    ] = 0.88
    max_slew: Annotated[float, about("largest change of force", "N/s", gt=0, le=10_000)] = 500.0
    max_speed: Annotated[float, about("stylus speed above which the force is cut", "m/s", gt=0, le=10)] = 1.0
    stale_after_ms: Annotated[float, about("age of the last force at which it begins to fade", "ms", gt=0, le=1000)] = (
        9.0
    )
    fade_ms: Annotated[float, about("time a stale force takes to fade to zero", "ms", gt=0, le=1000)] = 50.0
    disarm_after_ms: Annotated[
        float, about("age of the last force at which the device is disarmed", "ms", gt=0, le=10_000)
    ] = 100.0
    hold_damping: Annotated[float, about("damping while a stale force fades", "N s/m", ge=0, le=5)] = 1.0
    arm_time: Annotated[float, about("ramp from no force to full force after arming", "s", gt=0, le=10)] = 1.0
    arm_gate: Annotated[float, about("arming waits until the wanted force is below this", "N", gt=0, le=5)] = 0.2
    passivity: Annotated[
        StrictBool, about("true: the agent keeps forces that come late from making energy (passivity control)")
    ] = False


@dataclass(frozen=True, slots=True)
class Fixture:
    """The lateral constraint: the stylus is held in the vertical line x = y = 0 by the agent itself (reading B9)."""

    __pydantic_config__ = NO_EXTRAS
    stiffness: Annotated[float, about("stiffness towards x = y = 0", "N/m", ge=0, le=2000)] = 400.0
    damping: Annotated[float, about("damping of x and y", "N s/m", ge=0, le=20)] = 4.0


@dataclass(frozen=True, slots=True)
class Agent:
    """One device and the agent that owns it."""

    __pydantic_config__ = NO_EXTRAS
    device: Annotated[
        str, about("device backend, of those that `netboard devices list` names: openhaptics, mouse, ...", min_length=1)
    ] = "virtual"
    zero: Annotated[float, about("height of the device's own origin that is the scene's z = 0", "m", ge=-1, le=1)] = 0.0
    stop_buttons: Annotated[
        int, about("sum of the bits of buttons that are an emergency stop", "1", ge=0, le=65535)
    ] = 0
    consent_buttons: Annotated[
        int, about("sum of the bits of buttons that must be held down for a force; 0: none", "1", ge=0, le=65535)
    ] = 0
    velocity: Annotated[
        Literal["device", "adaptive", "chai3d", "difference", "alpha_beta", "kalman"],
        about("who estimates the stylus' velocity: the device or its driver, or netboard from the positions, and how"),
    ] = "device"
    options: Annotated[dict[str, str | int | float | bool], about("options handed to the device backend")] = field(
        default_factory=dict
    )


@dataclass(frozen=True, slots=True)
class Agents:
    """The two agents."""

    __pydantic_config__ = NO_EXTRAS
    profiles: Annotated[
        str, about("folder of the profiles of devices, which are named after serial numbers", min_length=1)
    ] = "profiles"
    left: Agent = field(default_factory=Agent)
    right: Agent = field(default_factory=Agent)


@dataclass(frozen=True, slots=True)
class VirtualDevice:
    """The simulated device of the ``virtual`` backend; "model" stands for its model's number (docs/participants.md)."""

    __pydantic_config__ = NO_EXTRAS
    model: Annotated[
        Literal["touch", "omni", "touch_x", "premium_1_5", "premium_3_0", "falcon", "omega_3"],
        about("device that it stands for, whose numbers count where none is written"),
    ] = "touch"
    mass: Annotated[float, about("apparent mass at the stylus", "kg", gt=0, le=5)] | OfModel = "model"
    friction: Annotated[float, about("Coulomb friction of the mechanism", "N", ge=0, le=5)] | OfModel = "model"
    damping: Annotated[float, about("viscous damping of the mechanism", "N s/m", ge=0, le=20)] | OfModel = "model"
    resolution: (
        Annotated[float, about("size of one encoder step at the stylus; 0: none", "m", ge=0, le=0.01)] | OfModel
    ) = "model"
    max_force: Annotated[float, about("largest force the motors give", "N", gt=0, le=40)] | OfModel = "model"
    continuous_force: Annotated[float, about("largest force they give for ever", "N", gt=0, le=40)] | OfModel = "model"
    workspace: Annotated[float, about("radius of the workspace", "m", gt=0, le=1)] | OfModel = "model"
    cable_stiffness: (
        Annotated[float, about("stiffness between motors and stylus; 0: rigid", "N/m", ge=0, le=100_000)] | OfModel
    ) = 0.0
    cable_damping: (
        Annotated[float, about("damping between motors and stylus, if not rigid", "N s/m", ge=0, le=1000)] | OfModel
    ) = "model"
    tip_share: (
        Annotated[float, about("share of the mass on the stylus' side of the cables", "1", gt=0, lt=1)] | OfModel
    ) = "model"
    thermal_time: (
        Annotated[float, about("time constant of the motors' temperature; 0: they stay cool", "s", ge=0, le=10_000)]
        | OfModel
    ) = 0.0
    read_latency_ms: Annotated[
        float, about("time from a position to its reading, of which the device does not know", "ms", ge=0, le=1000)
    ] = 0.0
    write_latency_ms: Annotated[float, about("time from a force's writing to its acting", "ms", ge=0, le=1000)] = 0.0


@dataclass(frozen=True, slots=True)
class Participant:
    """The simulated person: arm, senses and controller."""

    __pydantic_config__ = NO_EXTRAS
    arm_mass: Annotated[float, about("effective mass of hand and arm", "kg", gt=0, le=10)] = 0.5
    arm_damping: Annotated[float, about("damping of the arm", "N s/m", ge=0, le=100)] = 8.0
    arm_stiffness: Annotated[
        float, about("stiffness of the arm towards its equilibrium point", "N/m", gt=0, le=2000)
    ] = 150.0
    muscle_lag: Annotated[float, about("each of the two muscle lags", "s", gt=0, le=1)] = 0.040
    force_noise: Annotated[float, about("standard deviation of the arm's force noise", "N", ge=0, le=1)] = 0.02
    kp: Annotated[float, about("wanted ball acceleration per distance to the target", "1/s2", ge=0, le=100)] = 2.17
    kd: Annotated[float, about("wanted ball acceleration per ball velocity", "1/s", ge=0, le=100)] = 2.50
    max_tilt_deg: Annotated[float, about("largest tilt asked for", "deg", gt=0, le=45)] = 2.97
    lookahead: Annotated[float, about("prediction, in units of the visual delay", "1", ge=0, le=10)] = 2.1
    threshold_deg: Annotated[float, about("tilt error that triggers a submovement", "deg", ge=0, le=45)] = 0.93
    threshold_cv: Annotated[float, about("variability of that threshold", "1", ge=0, le=2)] = 0.44
    refractory: Annotated[float, about("shortest time between submovements", "s", ge=0, le=5)] = 0.296
    movement_time: Annotated[float, about("duration of a submovement", "s", gt=0, le=5)] = 0.313
    movement_cv: Annotated[float, about("variability of that duration", "1", ge=0, le=2)] = 0.15
    amplitude_cv: Annotated[float, about("variability of a submovement's amplitude", "1", ge=0, le=2)] = 0.08
    visual_delay: Annotated[float, about("delay of what is seen", "s", ge=0, le=2)] = 0.175
    haptic_delay: Annotated[float, about("delay of what is felt", "s", ge=0, le=2)] = 0.070
    reaction_time: Annotated[float, about("delay of the first movement of a trial", "s", ge=0, le=5)] = 0.32
    position_noise: Annotated[float, about("standard deviation of the seen ball position", "m", ge=0, le=1)] = 0.003
    velocity_noise: Annotated[float, about("standard deviation of the seen ball velocity", "m/s", ge=0, le=1)] = 0.010
    tilt_noise_deg: Annotated[float, about("standard deviation of the seen tilt", "deg", ge=0, le=45)] = 0.25
    partner_noise: Annotated[float, about("uncertainty about the partner's movement", "1", ge=0, le=5)] = 0.5
    centring: Annotated[float, about("pull of the hand's height towards the neutral height", "1", ge=0, le=2)] = 0.46
    haptic_gain: Annotated[
        float, about("weight of the partner's height inferred from one's own force", "1", ge=0, le=1)
    ] = 0.45
    haptic_noise: Annotated[float, about("standard deviation of that inferred height", "m", ge=0, le=1)] = 0.002
    bimanual_async: Annotated[
        float, about("standard deviation of the onset difference between one person's hands", "s", ge=0, le=1)
    ] = 0.045
    bimanual_amplitude_cv: Annotated[
        float, about("variability of the amplitude between one person's hands", "1", ge=0, le=2)
    ] = 0.2


@dataclass(frozen=True, slots=True)
class Display:
    """The participants' windows."""

    __pydantic_config__ = NO_EXTRAS
    width: Annotated[int, about("window width in pixels", "1", ge=200, le=20_000)] = 1200
    height: Annotated[int, about("window height in pixels", "1", ge=150, le=20_000)] = 700
    fullscreen: Annotated[StrictBool, about("true: the whole screen, no frame")] = False
    screen: Annotated[int, about("number of the screen the window opens on; 0: the main one", "1", ge=0, le=15)] = 0
    mm_per_pixel: Annotated[
        float, about("size of a pixel, so that the board has its true size; 0: it fills the window", "mm", ge=0, le=10)
    ] = 0.0
    language: Annotated[str, about("en, de, fr, es, it, or a file of words", min_length=1)] = "en"
    smooth: Annotated[StrictBool, about("true: what moves is drawn at every refresh, between the views")] = True
    patch: Annotated[StrictBool, about("true: a patch in the corner, for a photodiode, is white in a trial")] = False
    markers: Annotated[
        str, about("where trial events are marked as they are painted: none, lsl, or a serial port such as /dev/ttyS0")
    ] = "none"
    link_timeout_ms: Annotated[
        float, about("without a view for this long the window blanks", "ms", gt=0, le=60_000)
    ] = 500.0


@dataclass(frozen=True, slots=True)
class Recording:
    """Where and how the logger writes."""

    __pydantic_config__ = NO_EXTRAS
    directory: Annotated[str, about("folder of the recordings", min_length=1)] = "recordings"
    flush_ms: Annotated[float, about("a chunk is written and synced at least this often", "ms", gt=0, le=5000)] = 200.0
    chunk_bytes: Annotated[
        int, about("a chunk is written when it grows to this size, in bytes", "1", ge=1024, le=2**24)
    ] = 262_144


@dataclass(frozen=True, slots=True)
class Config:
    """Everything: one rig and one experiment."""

    __pydantic_config__ = NO_EXTRAS
    session: Session = field(default_factory=Session)
    block: Block = field(default_factory=Block)
    quality: Quality = field(default_factory=Quality)
    task: Task = field(default_factory=Task)
    physics: Physics = field(default_factory=Physics)
    geometry: Geometry = field(default_factory=Geometry)
    network: Network = field(default_factory=Network)
    realtime: Realtime = field(default_factory=Realtime)
    safety: Safety = field(default_factory=Safety)
    fixture: Fixture = field(default_factory=Fixture)
    agents: Agents = field(default_factory=Agents)
    virtual: VirtualDevice = field(default_factory=VirtualDevice)
    participant: Participant = field(default_factory=Participant)
    display: Display = field(default_factory=Display)
    recording: Recording = field(default_factory=Recording)


ADAPTER: TypeAdapter[Config] = TypeAdapter(Config)


def parse(text: str, source: str = "netboard.toml", overrides: Sequence[str] = ()) -> Config:
    """Check a TOML text and turn it into a `Config`.

    Parameters
    ----------
    text : str
        The TOML text; missing tables and keys take their defaults.
    source : str
        Name of the file, for error messages.
    overrides : sequence of str
        Settings as ``table.key=value`` that go before those of the text.

    Returns
    -------
    Config
        The configuration.

    Raises
    ------
    ConfigError
        If the text is not TOML, a key is unknown, of the wrong type or out of range, or two keys contradict each
        other. The message has a line for every problem.
    """
    config = read(ADAPTER, Config, text, source, overrides)
    origin = f"{source} with --set" if overrides else source
    problems = [f"{origin}: {problem}" for problem in contradictions(config)]
    if problems:
        raise ConfigError("\n".join(problems))
    return config


def resolve(config: Config) -> str:
    """Write a configuration in full.

    Parameters
    ----------
    config : Config
        The configuration.

    Returns
    -------
    str
        TOML text with every key; `parse` makes of it an equal configuration, to the last bit.
    """
    return write(config)


def template() -> str:
    """Write the defaults with a comment at every key, as a file to start from.

    Returns
    -------
    str
        TOML text.
    """
    return TEMPLATE_HEAD + write_template(Config)


def played_sides(config: Config) -> tuple[Side, ...]:
    """Which sides are played in their display's window.

    Parameters
    ----------
    config : Config
        The configuration.

    Returns
    -------
    tuple of {"left", "right"}
        Those whose device is the mouse.
    """
    agents = {"left": config.agents.left, "right": config.agents.right}
    return tuple(side for side in SIDES if agents[side].device == MOUSE)


def digest(config: Config) -> str:
    """Fingerprint of a configuration: equal configurations have equal fingerprints.

    Parameters
    ----------
    config : Config
        The configuration.

    Returns
    -------
    str
        SHA-256 of the resolved text, in hexadecimal.
    """
    return hashlib.sha256(resolve(config).encode()).hexdigest()


def contradictions(config: Config) -> Iterator[str]:
    """Find keys that are right each by itself and wrong together.

    Parameters
    ----------
    config : Config
        The configuration.

    Yields
    ------
    str
        One sentence for each, with table, key, value and what is expected.
    """
    geometry, task, physics, safety = config.geometry, config.task, config.physics, config.safety
    yield from _contradictory_scene(physics)
    yield from _contradictory_block(config.block)
    yield from _contradictory_force(config.block, physics)
    edge, half = geometry.board_length / 2, geometry.target_width / 2
    outer = geometry.target_distance + half
    if outer > edge:
        yield (
            f"[geometry] target_distance, target_width: the target ends {outer:g} m from the board's centre, "
            f"expected within the board, which ends at {edge:g} m"
        )
    if 2 * geometry.target_distance <= half:
        yield (
            f"[geometry] target_distance: found {geometry.target_distance:g}, expected more than {half / 2:g} m, "
            "so that the ball does not start inside the target"
        )
    if physics.l > edge:
        yield f"[physics] l: found {physics.l:g}, expected a control point on the board, at most {edge:g} m"
    if task.fall_distance < outer:
        yield (
            f"[task] fall_distance: found {task.fall_distance:g}, expected at least {outer:g} m, the target's far edge"
        )
    if task.fall_distance > edge + geometry.ball_radius:
        yield (
            f"[task] fall_distance: found {task.fall_distance:g}, expected at most {edge + geometry.ball_radius:g} m, "
            "where the ball has left the board"
        )
    if task.stylus_range >= physics.l:
        yield (
            f"[task] stylus_range: found {task.stylus_range:g}, expected less than {physics.l:g} m ([physics] l), "
            "or the board could stand upright"
        )
    if 0 < physics.ball_stop < geometry.target_distance:
        yield (
            f"[physics] ball_stop: found {physics.ball_stop:g}, expected at least {geometry.target_distance:g} m "
            "([geometry] target_distance), or the ball could not reach the target; 0 for no stops"
        )
    if task.level_height > task.stylus_range:
        yield (
            f"[task] level_height: found {task.level_height:g}, expected at most {task.stylus_range:g} m "
            "([task] stylus_range)"
        )
    if safety.disarm_after_ms < safety.stale_after_ms + safety.fade_ms:
        yield (
            f"[safety] disarm_after_ms: found {safety.disarm_after_ms:g}, expected at least "
            f"{safety.stale_after_ms + safety.fade_ms:g} ms, the time a stale force takes to begin and end its fade"
        )
    if safety.arm_gate > safety.max_force:
        yield f"[safety] arm_gate: found {safety.arm_gate:g}, expected at most {safety.max_force:g} N (max_force)"


def _contradictory_block(block: Block) -> Iterator[str]:
    """Find parts of a block that do not go together."""
    if block.number > block.blocks:
        yield f"[block] number: found {block.number}, expected at most {block.blocks} ([block] blocks)"
    if (block.force == "unrelated") != bool(block.unrelated):
        wanted = 'a recording, which force = "unrelated" needs' if not block.unrelated else 'none without "unrelated"'
        yield f'[block] unrelated: found "{block.unrelated}", expected {wanted}'
    if block.left != "person" and block.right != "person":
        yield f'[block] left, right: found "{block.left}" and "{block.right}", expected a "person" at one of them'
    if block.configuration == "bimanual" and (block.left, block.right) != ("person", "person"):
        yield '[block] left, right: expected "person" and "person" in a bimanual block'
    for trial in block.catch:
        if not 1 <= trial <= MOST_TRIALS:
            yield f"[block] catch: found {trial}, expected numbers of trials, from 1 to {MOST_TRIALS}"


def _contradictory_force(block: Block, physics: Physics) -> Iterator[str]:
    """Find what agents cannot render by themselves: they know the board's end of their coupling, and nothing more."""
    if physics.coupling_at != "both" or not block.haptics:
        return
    needs: dict[str, tuple[bool, str]] = {
        "force": (block.force == "full", '"full" or "none"'),
        "force_scale": (block.force_scale == 1.0, "1"),
        "force_delay_ms": (block.force_delay_ms == 0, "0"),
        "catch": (not block.catch, "none"),
        "left": (block.left == "person", '"person"'),
        "right": (block.right == "person", '"person"'),
    }
    for key, (fine, expected) in needs.items():
        if not fine:
            found = getattr(block, key)
            said = f'"{found}"' if isinstance(found, str) else str(list(found) if key == "catch" else found)
            yield f'[block] {key}: found {said}, expected {expected} with [physics] coupling_at = "both"'


def _contradictory_scene(physics: Physics) -> Iterator[str]:
    """Find parts of a scene that do not go together."""
    needs: dict[str, tuple[bool, str]] = {
        "ball_inertia": (physics.balls > 0, "balls = 1 or more"),
        "ball_stop": (physics.balls > 0, "balls = 1 or more"),
        "restitution": (physics.ball_stop > 0, "a ball_stop"),
        "ball_height": (physics.model == "lagrangian", 'model = "lagrangian": in the paper\'s a ball is a point'),
        "b_z": (physics.board != "hinged", "a board that heaves"),
        "b_theta": (physics.board != "level", "a board that tilts"),
    }
    for key, (there, what) in needs.items():
        if getattr(physics, key) > 0 and not there:
            yield f"[physics] {key}: found {getattr(physics, key):g}, which needs {what}; expected 0"
    if physics.ball_height > 0 and physics.balls == 0:
        yield f"[physics] ball_height: found {physics.ball_height:g}, which needs balls = 1 or more; expected 0"
    if physics.model == "lagrangian" and physics.ball_sign == "printed":
        yield (
            '[physics] ball_sign: found "printed", expected "downhill": only the paper\'s model can have a ball '
            "that rolls uphill"
        )
    if physics.method == "exact" and physics.board != "level":
        yield '[physics] method: found "exact", expected another one: it is for board = "level"'
