"""Models of the partner: what a simulated participant does with the force that it feels from the other.

A model says what the force tells, and how the arm answers to it. All other parameters are the same in each, so a
difference between two models is the effect of what one of them does. A number of the arm that is "model" in the
configuration is that of the model; a number that is written there replaces it.
"""

from typing import Literal, NamedTuple, get_args

from netboard.base.tables.simulated import Participant, PartnerModel


class PartnerModelParts(NamedTuple):
    """What a model of the partner consists of."""

    tells: Literal["nothing", "sight", "position", "goal"]  # what a participant infers, and from what
    reflex_gain: float  # yielding to an unexpected force [1]
    impedance_gain: float  # rate of stiffening per distance from the aim [N/m/(m s)]
    does: str
    source: str


_PULLED, _BOUND = "where the partner's hand is being pulled to", "where the partner's movement will end"
_TAKAGI = "Takagi et al. 2017"

PARTNER_MODELS: dict[PartnerModel, PartnerModelParts] = {
    "mechanics": PartnerModelParts(
        "nothing", 0.0, 0.0, "the force pushes the hand, no more (co-activity)", "Takagi, Beckers and Burdet 2016"
    ),
    "follower": PartnerModelParts(
        *("nothing", 1.0, 0.0, "the hand goes along with an unexpected force, as if the arm were half as stiff"),
        "a follower lowers the force between partners: Jarrassé, Charalambous and Burdet 2012; the gain is assumed",
    ),
    "sight": PartnerModelParts(
        *("sight", 0.0, 0.0, f"infers {_PULLED} from what is seen alone; the force pushes the hand, no more"),
        "a control: the filter of the next models without touch",
    ),
    "position": PartnerModelParts("position", 0.0, 0.0, f"infers {_PULLED} (position exchange)", _TAKAGI),
    "goal": PartnerModelParts("goal", 0.0, 0.0, f"infers {_BOUND} (goal exchange)", _TAKAGI),
    "impedance": PartnerModelParts(
        *("nothing", 0.0, 20_000.0, "the arm stiffens where the hand misses its aim (adaptive impedance)"),
        "the law of Franklin et al. 2008; the gain is assumed: 100 N/m in each second with an error of 5 mm",
    ),
}
"""Models, by their names in ``participant.partner_model``; the default of the configuration is one of them."""

if tuple(PARTNER_MODELS) != get_args(PartnerModel):
    raise ImportError(f"PARTNER_MODELS: found {tuple(PARTNER_MODELS)}, expected {get_args(PartnerModel)}")

INFORMED: tuple[PartnerModel, ...] = tuple(
    name for name, one in PARTNER_MODELS.items() if one.tells in ("position", "goal")
)
"""Models in which the force tells something of the partner."""


def tells(person: Participant) -> Literal["nothing", "sight", "position", "goal"]:
    """Return what a participant infers: "nothing", "sight" (from what is seen alone), "position" or "goal"."""
    return PARTNER_MODELS[person.partner_model].tells


def arm_gain(person: Participant, name: Literal["reflex_gain", "impedance_gain"]) -> float:
    """Return a gain of the arm: that of the configuration, or else of the model of the partner."""
    value = getattr(person, name)
    return float(getattr(PARTNER_MODELS[person.partner_model], name) if value == "model" else value)
