"""Configuration tables of the simulated device and the simulated participant.

`netboard.base.config` reads the tables and gives the common rules.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from netboard.base.settings import FORBID_UNKNOWN_KEYS, about

OfModel = Literal["model"]
OfPlan = Literal["plan"]
PartnerModel = Literal["mechanics", "follower", "sight", "position", "goal", "impedance"]


@dataclass(frozen=True, slots=True)
class VirtualDevice:
    """The simulated device of the ``virtual`` backend; "model" stands for the value of its model."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    model: Annotated[
        Literal["touch", "omni", "touch_x", "premium_1_5", "premium_3_0", "falcon", "omega_3"],
        about("simulated device; its values are the defaults of the keys below"),
    ] = "touch"
    mass: Annotated[float, about("apparent mass at the stylus", "kg", gt=0, le=5)] | OfModel = "model"
    friction: Annotated[float, about("Coulomb friction of the mechanism", "N", ge=0, le=5)] | OfModel = "model"
    damping: Annotated[float, about("viscous damping of the mechanism", "N s/m", ge=0, le=20)] | OfModel = "model"
    resolution: (
        Annotated[float, about("size of one encoder step at the stylus; 0: none", "m", ge=0, le=0.01)] | OfModel
    ) = "model"
    max_force: Annotated[float, about("peak force of the motors", "N", gt=0, le=40)] | OfModel = "model"
    continuous_force: Annotated[float, about("continuous force of the motors", "N", gt=0, le=40)] | OfModel = "model"
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
        float, about("sensing delay that the device's time stamps do not include", "ms", ge=0, le=1000)
    ] = 0.0
    write_latency_ms: Annotated[float, about("actuation delay", "ms", ge=0, le=1000)] = 0.0


@dataclass(frozen=True, slots=True)
class Participant:
    """The simulated participant: arm, senses and controller; "model" stands for the value of its partner model."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    arm_mass: Annotated[float, about("effective mass of hand and arm", "kg", gt=0, le=10)] = 0.5
    arm_damping: Annotated[float, about("damping of the arm", "N s/m", ge=0, le=100)] = 8.0
    arm_stiffness: Annotated[
        float, about("stiffness of the arm towards its equilibrium point", "N/m", gt=0, le=2000)
    ] = 150.0
    muscle_lag: Annotated[float, about("each of the two muscle lags", "s", gt=0, le=1)] = 0.040
    force_noise: Annotated[float, about("standard deviation of the arm's force noise", "N", ge=0, le=1)] = 0.02
    force_noise_time: Annotated[float, about("correlation time of that noise", "s", gt=0, le=10)] = 0.1
    forearm: Annotated[
        float,
        about(
            "distance from elbow to stylus: a hand at height z is nearer to the body by z^2/(2 forearm)",
            "m",
            gt=0,
            le=2,
        ),
    ] = 0.30
    lateral_sd: Annotated[
        float, about("standard deviation of the hand's rest position across the line", "m", ge=0, le=0.1)
    ] = 0.002
    aim_beyond_stop: Annotated[
        float, about("largest distance beyond a mechanical stop at which a hand aims", "m", ge=0, le=1)
    ] = 0.02
    friction_skill: Annotated[
        float,
        about(
            "share of the device's friction that the arm compensates while its equilibrium point moves", "1", ge=0, le=1
        ),
    ] = 0.8
    compensation_speed: Annotated[
        float,
        about(
            "speed of the equilibrium point at which the compensation that acts only then is full", "m/s", gt=0, le=1
        ),
    ] = 0.005
    rest_skill: Annotated[float, about("share of that compensation that also acts at rest", "1", ge=0, le=1)] = 1.0
    load_skill: Annotated[float, about("share of an expected force that the arm compensates", "1", ge=0, le=1)] = 1.0
    reflex_gain: (
        Annotated[
            float,
            about("yielding of the arm to an unexpected force, relative to its yielding by stiffness", "1", ge=0, le=5),
        ]
        | OfModel
    ) = "model"
    reflex_delay: Annotated[float, about("delay of the responses to a force", "s", ge=0, le=0.1)] = 0.060
    reflex_time: Annotated[float, about("time after which a force is expected", "s", gt=0, le=10)] = 0.3
    impedance_gain: (
        Annotated[
            float,
            about(
                "rate of stiffening per distance of the hand from its equilibrium point; 0: none",
                "N/m/(m s)",
                ge=0,
                le=1e6,
            ),
        ]
        | OfModel
    ) = "model"
    impedance_decay: Annotated[
        float, about("rate at which the stiffness returns to that of the relaxed arm", "N/m/s", ge=0, le=10_000)
    ] = 20.0
    impedance_limit: Annotated[float, about("largest stiffness, relative to the relaxed arm", "1", ge=1, le=10)] = 3.0
    kp: Annotated[float, about("proportional gain: ball acceleration per distance", "1/s2", ge=0, le=100)] = 2.17
    kd: Annotated[float, about("derivative gain: ball acceleration per velocity", "1/s", ge=0, le=100)] = 2.50
    max_tilt_deg: Annotated[float, about("largest desired tilt", "deg", gt=0, le=45)] = 2.97
    lookahead: Annotated[float, about("prediction horizon, in units of the visual delay", "1", ge=0, le=10)] = 2.1
    threshold_deg: Annotated[float, about("tilt error that triggers a submovement", "deg", ge=0, le=45)] = 1.13
    threshold_cv: Annotated[float, about("variability of that threshold", "1", ge=0, le=2)] = 0.44
    threshold_limit: Annotated[
        float,
        about(
            "largest threshold, over the largest desired tilt; below 1, so that no draw stops all action",
            "1",
            gt=0,
            lt=1,
        ),
    ] = 0.95
    level_margin: Annotated[
        float, about("share of the levelling limits above which tilt or height is corrected", "1", gt=0, le=1)
    ] = 0.7
    refractory: Annotated[float, about("shortest time between submovements", "s", ge=0, le=5)] = 0.283
    movement_time: Annotated[float, about("duration of a submovement", "s", gt=0, le=5)] = 0.30
    movement_cv: Annotated[float, about("variability of that duration", "1", ge=0, le=2)] = 0.15
    amplitude_cv: Annotated[float, about("variability of a submovement's amplitude", "1", ge=0, le=2)] = 0.08
    visual_delay: Annotated[float, about("visual delay", "s", ge=0, le=2)] = 0.175
    haptic_delay: Annotated[float, about("haptic delay", "s", ge=0, le=2)] = 0.070
    reaction_time: Annotated[float, about("delay of the first movement of a trial", "s", ge=0, le=5)] = 0.32
    reaction_cv: Annotated[float, about("variability of that delay", "1", ge=0, le=2)] = 0.2
    velocity_span: Annotated[
        float, about("window over which the ball's velocity is estimated from its positions", "s", gt=0, le=0.2)
    ] = 0.05
    position_noise: Annotated[float, about("standard deviation of the seen ball position", "m", ge=0, le=1)] = 0.0026
    velocity_noise: Annotated[float, about("standard deviation of the seen ball velocity", "m/s", ge=0, le=1)] = 0.0087
    tilt_noise_deg: Annotated[float, about("standard deviation of the seen tilt", "deg", ge=0, le=45)] = 0.22
    partner_noise: Annotated[float, about("uncertainty about the partner's movement", "1", ge=0, le=5)] = 0.5
    stranger: Annotated[
        float, about("uncertainty about an unknown partner, relative to a known one; 1: no learning", "1", ge=1, le=100)
    ] = 2.0
    reading: Annotated[
        float,
        about(
            "share of what the force tells that is understood of an unknown partner; 1: no learning", "1", ge=0, le=1
        ),
    ] = 0.0
    partner_model: Annotated[
        PartnerModel,
        about("what the participant infers of its partner, and does with the force that it feels"),
    ] = "position"
    mirror: Annotated[
        float,
        about("initial share of its own tilting that a participant expects the partner to mirror", "1", ge=0, le=1),
    ] = 0.65
    mirror_rate: Annotated[
        float, about("learning rate of that share, per movement; 0: no learning", "1", ge=0, le=1)
    ] = 0.01
    centring: Annotated[float, about("correction of the hand's height towards the neutral height", "1", ge=0, le=2)] = (
        0.46
    )
    weber_fraction: Annotated[
        float,
        about("standard deviation of a perceived force, relative to the force that the hand carries", "1", ge=0, le=1),
    ] = 0.1
    noise_time: Annotated[float, about("correlation time of the noise of the senses", "s", gt=0, le=10)] = 0.2
    goal_speed: Annotated[
        float,
        about(
            "natural frequency with which the partner's hand approaches its goal, times the movement time",
            "1",
            gt=0,
            le=100,
        ),
    ] = 4.0
    bimanual_async: Annotated[
        float, about("standard deviation of the onset difference between one person's hands", "s", ge=0, le=1)
    ] = 0.055
    bimanual_amplitude_cv: Annotated[
        float, about("variability of the amplitude between one person's hands", "1", ge=0, le=2)
    ] = 0.2
    novice: Annotated[
        float,
        about(
            "noise, thresholds and reaction time of a novice, relative to a trained participant; 1: no learning",
            "1",
            ge=1,
            le=100,
        ),
    ] = 1.29
    learning_trials: Annotated[
        float, about("trials after which 1/e of the difference remains", "1", gt=0, le=10_000)
    ] = 200.0
    practice: Annotated[float, about("trials practised before the block", "1", ge=0, le=100_000)] | OfPlan = "plan"
    acquaintance: (
        Annotated[float, about("dyadic trials performed before the block", "1", ge=0, le=100_000)] | OfPlan
    ) = "plan"
    felt_trials: (
        Annotated[float, about("dyadic trials performed with the full force before the block", "1", ge=0, le=100_000)]
        | OfPlan
    ) = "plan"


_ARM = "assumed; published arms in posture have 0.5 to 1.5 kg, 5 to 30 N s/m, 100 to 500 N/m"
_ADJUSTED = "adjusted to bimanual trials with haptic feedback off, in 16 noisy evaluations"
_SEARCHED = "an earlier random search on all of the paper's figures"
_BY_HAND = "chosen by hand after inspecting trials with haptic feedback and of dyads"
_ASSUMED = "assumed"

PARTICIPANT_SOURCES = {
    name: source
    for names, source in {
        ("arm_mass", "arm_damping", "arm_stiffness"): _ARM,
        ("muscle_lag",): "a model: Lokesh et al. 2023",
        ("visual_delay",): "assumed; models have 0.08 s (Takagi et al. 2017) and 0.1 s (Lokesh et al. 2023)",
        (
            "haptic_delay",
            "reflex_delay",
        ): "of responses to perturbations: Cluff, Crevecoeur and Scott 2015",
        ("rest_skill", "load_skill", "mirror_rate"): _BY_HAND,
        ("impedance_decay", "impedance_limit"): "assumed; the law is that of Franklin et al. 2008",
        ("reflex_gain", "impedance_gain"): "that of the partner model",
        ("kp", "kd", "max_tilt_deg", "lookahead", "partner_noise", "centring"): _SEARCHED,
        ("threshold_cv", "movement_cv", "amplitude_cv", "bimanual_amplitude_cv", "mirror"): _SEARCHED,
        ("threshold_deg", "refractory", "movement_time"): _ADJUSTED,
        ("position_noise", "velocity_noise", "tilt_noise_deg", "bimanual_async", "novice"): _ADJUSTED,
        ("partner_model",): "assumed; goal exchange explained people best: Takagi et al. 2017",
        ("weber_fraction",): "extrapolated: 7 to 10 % at 2.5 to 10 N, Pang, Tan and Durlach 1991",
        ("goal_speed",): "a critically damped approach that is as late, on average, as a submovement",
        ("force_noise", "force_noise_time", "forearm", "lateral_sd", "friction_skill", "compensation_speed"): _ASSUMED,
        ("reflex_time", "reaction_time", "reaction_cv", "noise_time", "velocity_span", "learning_trials"): _ASSUMED,
        ("aim_beyond_stop",): "assumed; aiming farther would not move the hand",
        ("threshold_limit",): "assumed; without it, one threshold in two thousand could never be exceeded",
        ("level_margin",): "assumed; at 1 the board would be left at the limit",
        ("stranger",): "assumed: an unknown partner may do nothing, or twice what is expected (a relative SD of 1)",
        ("reading",): "assumed: what a force tells has to be learned, from nothing",
        ("practice", "acquaintance", "felt_trials"): "number of trials in the plan",
    }.items()
    for name in names
}
"""Source of the default of each parameter of a simulated participant."""
