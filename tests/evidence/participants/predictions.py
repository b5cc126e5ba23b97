"""Results of virtual studies beside those of the paper: predictive intervals, directions, and the error of each model.

A virtual study is one of four dyads, one of each starting state, as the paper counterbalanced its own. Each dyad is in
one study only, so the studies are independent.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from evidence.participants.paper import DYADS, EXTRA, STATEMENTS, Sample, Statement
from evidence.participants.trials import Performance
from netboard.base.looks import PRINT_BODY
from netboard.benchmarks.harness.results import ResultPart

LIKELY = 0.8
"""Share of studies with the paper's direction from which a direction counts as reproduced; a convention [1]."""

Use = Literal["adjusted", "fitted"]
"""What used some of the paper's results: the adjustment of the defaults, or the fit of the posterior."""

_USES: dict[Use, str] = {"adjusted": "adjusted to", "fitted": "fitted to"}


def studies(performances: Sequence[Performance]) -> list[Sample]:
    """Return the virtual studies of dyads 1 to 4, 5 to 8, and so on; each has one dyad of each starting state."""
    if len(performances) % DYADS:
        raise ValueError(f"found {len(performances)} dyads, expected a multiple of {DYADS}")
    attempts = [one.attempts for one in performances]
    return [Sample(np.concatenate(attempts[first : first + DYADS])) for first in range(0, len(attempts), DYADS)]


@dataclass(frozen=True)
class Prediction:
    """Prediction of the model for a statement of the paper.

    - `values`: the quantity in each virtual study.
    """

    statement: Statement
    values: NDArray[np.float64]

    @property
    def interval(self) -> tuple[float, float, float]:
        """Median and limits of the 95 % predictive interval."""
        low, middle, high = np.percentile(self.values, (2.5, 50, 97.5))
        return float(middle), float(low), float(high)

    @property
    def inside(self) -> bool | None:
        """Whether the paper's value lies in the interval; None without a value."""
        _, low, high = self.interval
        value = self.statement.value
        return None if value is None else low <= value <= high

    @property
    def right(self) -> NDArray[np.bool_]:
        """Whether each study has the paper's direction."""
        return np.asarray(self.statement.sense * self.values > 0)

    @property
    def probability(self) -> float | None:
        """Share of studies with the paper's direction; None without one [1]."""
        return float(np.mean(self.right)) if self.statement.sense else None

    @property
    def probability_limits(self) -> tuple[float, float]:
        """Limits of the 95 % confidence interval of that share (Wilson) [1]."""
        limits = stats.binomtest(int(self.right.sum()), len(self.values)).proportion_ci(method="wilson")
        return float(limits.low), float(limits.high)

    @property
    def reproduced(self) -> str:
        """Whether the model reproduces the result: "yes", "NO", "unclear" or "not reported"."""
        if self.inside is not None:
            return "yes" if self.inside else "NO"
        if self.probability is None:
            return "not reported"
        return "yes" if self.probability >= LIKELY else "unclear" if self.probability >= 0.5 else "NO"

    @property
    def errors(self) -> NDArray[np.float64]:
        """Distance of each study from the paper's value, over that value, or over the largest possible one [1]."""
        statement = self.statement
        if statement.value is None:
            raise ValueError(f"{statement.name}: the paper prints no value")
        return np.asarray(np.abs(self.values - statement.value) / (statement.largest or statement.value))


def predictions(samples: Sequence[Sample]) -> list[Prediction]:
    """Evaluate all statements in virtual studies."""
    return [Prediction(one, np.array([one.of(sample) for sample in samples], float)) for one in (*STATEMENTS, *EXTRA)]


def unused(found: Sequence[Prediction], use: Use) -> list[Prediction]:
    """Return the paper's results that the adjustment or the fit did not use."""
    return [one for one in found if not getattr(one.statement, use)]


def reproduced_counts(found: Sequence[Prediction], use: Use) -> tuple[int, int, int, int]:
    """Return values inside, values, directions reproduced, and directions, among the results that were not used."""
    rest = unused(found, use)
    values = [one.reproduced for one in rest if one.inside is not None]
    directions = [one.reproduced for one in rest if one.probability is not None]
    return values.count("yes"), len(values), directions.count("yes"), len(directions)


def predictions_part(
    name: str, title: str, found: Sequence[Prediction], performances: Sequence[Performance], use: Use
) -> ResultPart:
    """Tabulate predictions of the model, and whether it reproduces each result."""
    part = ResultPart(
        name,
        f"Results of the paper: {title}",
        "result | use | paper | direction | median | 2.5 % | 97.5 % | P(direction) | reproduced",
    )
    for one in found:
        statement = one.statement
        value = "-" if statement.value is None else statement.value
        used = _USES[use] if getattr(statement, use) else "seen"
        part.add(statement.name, used, value, _direction(statement), *one.interval, _chance(one), one.reproduced)
    inside, values, likely, directions = reproduced_counts(found, use)
    for claim, yes, of in (
        ("value of the paper lies in its 95 % predictive interval", inside, values),
        (f"direction of the paper appears in at least {LIKELY:.0%} of the virtual studies", likely, directions),
    ):
        part.claim(f"every other {claim}", yes == of, f"{yes} of {of}")
    success = np.concatenate([one.attempts["success"] for one in performances])
    given_up = sum(one.given_up for one in performances)
    part.claim(
        "no simulated participant is excluded, and all blocks are completed",
        given_up == 0,
        f"{len(performances)} dyads: {given_up} blocks given up; "
        f"{np.sum(~success)} falls of the ball in {np.sum(success)} trials",
    )
    return part


def _chance(one: Prediction) -> str:
    """Format the share of studies with the paper's direction."""
    if one.probability is None:
        return "-"
    low, high = one.probability_limits
    return f"{one.probability:.2f} ({low:.2f} to {high:.2f})"


def _direction(statement: Statement) -> str:
    """Format the direction that the paper reports."""
    return {1: "above 0", -1: "below 0", 0: "-"}[statement.sense]


def models_part(found: dict[str, list[Prediction]], use: Use, name: str = "models") -> ResultPart:
    """Tabulate how near each model comes to the paper, and the difference from the first one, in the same dyads."""
    part = ResultPart(
        name,
        f"How near each model comes to the paper: results that it was not {_USES[use]}, the same dyads in each model",
        "model | values inside | directions | error of the values [%] | difference [points] | 95 % CI low "
        "| 95 % CI high | directions right [%] | difference [points] | 95 % CI low | 95 % CI high",
    )
    scores = {name: _scores(unused(variant, use)) for name, variant in found.items()}
    full = scores[next(iter(found))]
    for model, variant in found.items():
        inside, values, likely, directions = reproduced_counts(variant, use)
        cells: list[float] = []
        for own, other in zip(scores[model], full, strict=True):
            cells += [100.0 * float(own.mean()), *_paired(100.0 * (own - other))]
        rounded = (round(cell, 9) for cell in cells)  # a difference of equal means is 0
        part.add(model, f"{inside} of {values}", f"{likely} of {directions}", *rounded)
    return part


def _scores(found: Sequence[Prediction]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean error of the values, and the share of directions that are right, in each study [1]."""
    errors = [one.errors for one in found if one.inside is not None]
    right = [one.right for one in found if one.probability is not None]
    return np.mean(errors, axis=0), np.mean(right, axis=0)


def _paired(differences: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the mean of paired differences and the limits of its 95 % confidence interval (t)."""
    mean, count = float(differences.mean()), len(differences)
    if count < 2:
        return mean, float("nan"), float("nan")
    reach = float(stats.t.ppf(0.975, count - 1) * differences.std(ddof=1) / np.sqrt(count))
    return mean, mean - reach, mean + reach


def ablations_part(found: dict[str, list[Prediction]]) -> ResultPart:
    """Tabulate each result of each model: the median, and the share of studies with the direction."""
    part = ResultPart(
        "ablations",
        "Median and, in brackets, share of the studies with the direction, of each model in the same dyads",
        ("result", "paper", *found),
    )
    for k, one in enumerate(found[next(iter(found))]):
        statement = one.statement
        paper = _direction(statement) if statement.value is None else statement.value
        part.add(statement.name, paper, *(_cell(variant[k]) for variant in found.values()))
    return part


def _cell(one: Prediction) -> str:
    """Format a prediction: ! means that the result is not reproduced, ? that its direction is unclear."""
    mark = {"NO": " !", "unclear": " ?"}.get(one.reproduced, "")
    chance = "" if one.probability is None else f" ({one.probability:.2f})"
    return f"{one.interval[0]:.3g}{chance}{mark}"


DIFFERENCES = (
    "completion time [s], dyadic, first 30",
    "completion time [s], dyadic, last 30",
    "velocity peaks, dyadic, first 30",
    "cooperative share, bimanual, haptics on - off",
    "cooperative share, dyadic, haptics on - off",
    "single share, bimanual, haptics on - off",
    "single share, dyadic, haptics on - off",
    "competitive share, dyadic, haptics on - off",
    "delay [ms], dyadic, haptics on - off",
    "completion time, bimanual, haptics on/off - 1",
    "completion time, dyadic, haptics on/off - 1",
)
"""Quantities in which models are compared."""


def differences_part(found: dict[str, list[Prediction]], name: str = "differences") -> ResultPart:
    """Tabulate how much some quantities of each model differ from those of the first one, paired by study."""
    part = ResultPart(
        name,
        "Difference of each model from the full one, mean over studies of the same dyads and 95 % CI",
        ("result", *list(found)[1:]),
    )
    full = found[next(iter(found))]
    for k, one in enumerate(full):
        if one.statement.name not in DIFFERENCES:
            continue
        others = [variant[k].values - one.values for variant in list(found.values())[1:]]
        part.add(one.statement.name, *("{:.3g} ({:.3g} to {:.3g})".format(*_paired(other)) for other in others))
    return part


def draw(found: Sequence[Prediction]) -> Any:
    """Draw the predictive intervals of all printed values, relative to the paper's, and all directions."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7), layout="constrained")
    left, right = figure.subplots(1, 2)
    values = [one for one in found if one.statement.value is not None]
    for place, one in enumerate(reversed(values)):
        middle, low, high = (number / one.statement.value for number in one.interval)  # type: ignore[operator]
        colour = "C1" if one.statement.adjusted else "C0"
        left.plot([low, high], [place, place], color=colour)
        left.plot(middle, place, "o", color=colour, markersize=4)
    left.axvline(1.0, color="grey", linewidth=0.8)
    left.set_yticks(range(len(values)), [one.statement.name for one in reversed(values)], fontsize=PRINT_BODY)
    left.set(xlabel="model / paper: median and 95 % predictive interval", title="values (orange: adjusted to)")
    directions = [one for one in found if one.probability is not None]
    for place, one in enumerate(reversed(directions)):
        low, high = one.probability_limits
        colour = "C1" if one.statement.adjusted else "C0"
        right.plot([low, high], [place, place], color=colour)
        right.plot(one.probability, place, "o", color=colour, markersize=4)
    right.axvline(LIKELY, color="grey", linewidth=0.8)
    right.set_yticks(range(len(directions)), [one.statement.name for one in reversed(directions)], fontsize=PRINT_BODY)
    right.set(xlim=(0, 1.02), xlabel="share of the studies, 95 % CI", title="directions")
    return figure
