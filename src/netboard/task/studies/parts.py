"""The parts of a study: kinds of blocks, factors and their levels, questionnaires.

A part stores only the configuration keys that differ from the rig's configuration, under their own table and key.
`netboard.task.studies.study` reads and checks them.
"""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import StrictBool

from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.tables.experiment import Block, FactorType, Quality, Role, Task
from netboard.base.tables.perturbations import MAX_PERTURBED, Perturbation
from netboard.base.tables.questionnaires import SHIPPED, FormQuestion
from netboard.base.tables.rig import Display, Partners
from netboard.base.tables.scene import Geometry, Physics
from netboard.base.tables.simulated import Participant

CHANGED: dict[str, type[Any]] = {
    "block": Block,
    "perturbation": Perturbation,
    "task": Task,
    "physics": Physics,
    "geometry": Geometry,
    "quality": Quality,
    "display": Display,
    "participant": Participant,
    "partners": Partners,
}
"""Tables of the configuration that a study may change."""

PLANNED: dict[str, tuple[str, ...]] = {
    "block": (
        "number",
        "blocks",
        "label",
        "configuration",
        "performer",
        "station",
        "catch",
        "trial_scales",
        "instructions",
        "seed",
    ),
    "perturbation": ("trials", "opposite"),
}
"""Keys of each table that the plan sets, so a study may not."""

SESSION = "session"
"""Value of ``after`` for a questionnaire at the end of a session."""

WITHIN = "trial"
"""Order of a factor that varies over the trials of a block."""

ALL = "all"
"""Value of ``factors`` for every factor."""


@dataclass(frozen=True, slots=True)
class Changes:
    """Keys that differ from the rig's configuration, by table."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    block: Annotated[dict[str, Any], about("keys of [block] that differ")] = field(default_factory=dict)
    perturbation: Annotated[dict[str, Any], about("keys of [perturbation] that differ")] = field(default_factory=dict)
    task: Annotated[dict[str, Any], about("keys of [task] that differ")] = field(default_factory=dict)
    physics: Annotated[dict[str, Any], about("keys of [physics] that differ")] = field(default_factory=dict)
    geometry: Annotated[dict[str, Any], about("keys of [geometry] that differ")] = field(default_factory=dict)
    quality: Annotated[dict[str, Any], about("keys of [quality] that differ")] = field(default_factory=dict)
    display: Annotated[dict[str, Any], about("keys of [display] that differ")] = field(default_factory=dict)
    participant: Annotated[dict[str, Any], about("keys of [participant] (simulated participants) that differ")] = field(
        default_factory=dict
    )
    partners: Annotated[
        dict[str, Any], about("parameters of the robot partner at a side: partners.right.KEY, in place of all others")
    ] = field(default_factory=dict)
    instructions: Annotated[
        dict[str, str], about("what participants read before a block, by language: instructions.en")
    ] = field(default_factory=dict)

    def changed(self) -> dict[str, dict[str, Any]]:
        """Return the changed keys by table, without unchanged tables."""
        return {table: dict(getattr(self, table)) for table in CHANGED if getattr(self, table)}


@dataclass(frozen=True, slots=True)
class Level(Changes):
    """One level of a factor, with its changes. Its instructions follow those of the kind."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    other_hand: Annotated[
        str, about("mover of a lone participant's other hand, in place of that of the kind; empty: that of the kind")
    ] = ""
    value: Annotated[float, about("value of this level of a numeric factor", allow_inf_nan=False)] | Literal["auto"] = (
        "auto"
    )


@dataclass(frozen=True, slots=True)
class Factor:
    """A factor that varies over blocks, or over the trials of a block."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    order: Annotated[
        Literal["alternate", "latin", "random", "between", "trial"],
        about(
            "order of its levels: in turn, in rows of a balanced Latin square, in a new random order each time, one "
            "level for a whole dyad, or drawn trial by trial within each block"
        ),
    ] = "alternate"
    type: (
        Annotated[FactorType, about("type of its levels; auto: the type of the key that they set")] | Literal["auto"]
    ) = "auto"
    unit: Annotated[str, about("unit of a numeric factor; empty: the unit of the key that its levels set")] = ""
    levels: Annotated[dict[str, Level], about("levels by name, each with its changed keys")] = field(
        default_factory=dict
    )


@dataclass(frozen=True, slots=True)
class Kind(Changes):
    """One kind of block."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    performers: Annotated[
        Literal["dyad", "A", "B", "AB", "BA"],
        about("who performs it: the dyad, one participant alone, or both alone, one after the other"),
    ] = "dyad"
    role: (
        Annotated[Role, about("purpose of its trials: analyses use test trials; auto: from its name, else test")]
        | Literal["auto"]
    ) = "auto"
    other_hand: Annotated[
        str,
        about(
            'mover of a lone participant\'s other hand: "own" (bimanual), "person" (the other participant), "still", '
            "or a robot partner"
        ),
    ] = "own"
    factors: Annotated[tuple[str, ...], about('factors that vary over its blocks; "all": every one', strict=False)] = (
        ALL,
    )
    catch: Annotated[
        float,
        about("catch trials, without haptic feedback: below 1 the share, from 1 on the number", "1", ge=0, le=1000),
    ] = 0.0
    catch_after: Annotated[
        int, about("number of first trials in a block that are never catch trials", "1", ge=0, le=10_000)
    ] = 1
    perturbed: Annotated[
        float, about("perturbation trials: below 1 the share, from 1 on the number", "1", ge=0, le=MAX_PERTURBED)
    ] = 0.0
    perturbed_after: Annotated[
        int, about("number of first trials in a block that are never perturbed", "1", ge=0, le=10_000)
    ] = 1
    perturbed_both_ways: Annotated[
        StrictBool, about("true: in half of the perturbation trials the force has the opposite sign")
    ] = False

    def people(self) -> tuple[Literal["A", "B", "dyad"], ...]:
        """Return the performers of the blocks of one step, in turn."""
        by: dict[str, tuple[Literal["A", "B", "dyad"], ...]] = {
            "dyad": ("dyad",),
            "A": ("A",),
            "B": ("B",),
            "AB": ("A", "B"),
            "BA": ("B", "A"),
        }
        return by[self.performers]


@dataclass(frozen=True, slots=True)
class Questionnaire:
    """A questionnaire: a reminder to the operator, or questions at the participants' displays, or both."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    text: Annotated[str, about("text or web address for the operator")] = ""
    after: Annotated[
        tuple[str, ...], about('kinds of blocks that it follows; "session": after the last block', strict=False)
    ] = (SESSION,)
    form: Annotated[str, about('name of shipped questions, such as "person"; empty: its own questions')] = ""
    wait: Annotated[float, about("how long the next block waits for the participants' answers", "s", ge=0, le=3600)] = (
        120.0
    )
    questions: Annotated[dict[str, FormQuestion], about("questions to the participants, by name, in their order")] = (
        field(default_factory=dict)
    )

    def asked(self) -> dict[str, FormQuestion]:
        """Return the questions to the participants."""
        return self.questions or SHIPPED.get(self.form, {})
