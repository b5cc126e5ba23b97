"""Outcomes: the measures in which conditions are compared, and the declaration of a study's analysis.

The names stand here because studies are written and checked on machines without the libraries of an analysis;
`netboard.analysis.topics.measures` computes each, and fails at import if one is missing there. Recordings carry the
declaration as the table ``[analysis]`` of their configuration.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from netboard.base.settings import FORBID_UNKNOWN_KEYS, about

OUTCOMES = (
    "completion time",
    "velocity peaks",
    "SPARC",
    "LDLJ",
    "reaction time",
    "time in target",
    "overshoots",
    "falls per attempt",
    "cooperative share",
    "competitive share",
    "single share",
    "still share",
    "|delay at 20 %|",
    "|lag|",
    "effort",
    "interaction force",
    "exchanged energy",
)
"""Names of the measures that a study can declare as outcomes."""

MODELLED = ("completion time", "velocity peaks", "falls per attempt")
"""Outcomes with a model of all trials."""

Method = Literal["t", "permutation", "model"]
"""Method of a declared analysis: t test or permutation test of the dyads' contrasts, or the model of all trials."""


@dataclass(frozen=True, slots=True)
class Declaration:
    """What the study declares about its analysis before any data exist. Without a primary outcome it is exploratory."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    question: Annotated[str, about("question of the study, in its own words; the report begins with it")] = ""
    primary: Annotated[str, about("primary outcome: a measure, such as completion time; empty: none is declared")] = ""
    contrast: Annotated[
        str, about('what is compared: a factor or two, such as "haptics x kind", or "force: full vs none"')
    ] = ""
    method: Annotated[
        Method,
        about("test that counts: t test or permutation test of the dyads' contrasts, or the model of all trials"),
    ] = "t"
    level: Annotated[float, about("level of the confidence intervals", "1", ge=0.5, le=0.999)] = 0.95
    smallest_effect: Annotated[
        float,
        about(
            "smallest effect of interest, in the unit of the effect (0.1 for a ratio of 1.1); 0: none",
            "1",
            ge=0,
            le=1e6,
        ),
    ] = 0.0
    secondary: Annotated[tuple[str, ...], about("secondary outcomes: further measures", strict=False)] = ()
