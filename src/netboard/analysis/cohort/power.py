"""Power, false-positive rate and precision of paired contrasts, against the number of dyads.

The virtual studies of a cohort are divided into studies of fewer, consecutive dyads. No dyad belongs to two of them, so
they are independent; each keeps the counterbalancing. Each is tested as a real study is: paired t test and permutation
test of the dyads' differences. The contrasts here are exploratory, and not corrected, as in the report;
`netboard.analysis.cohort.decisions` has what the study declares.

The false-positive rate is that of the same differences minus the cohort's mean difference: there is no effect by
construction, and spread and skewness are those of the simulated dyads. For the t test it equals one minus the coverage
of the confidence interval. A study whose dyads all have the same difference, such as one without any fall, rejects in
neither test without the effect: what the subtraction leaves there is no evidence of a difference.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan, sqrt
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from scipy.special import stdtrit

from netboard.analysis.cohort.rows import KEPT, SIZE, CohortMeasure
from netboard.analysis.statistics.estimates import ROUNDING
from netboard.analysis.statistics.exact_tests import least_permutation_p, permutation_p
from netboard.analysis.topics.contrasts import SEED
from netboard.analysis.topics.groups import paired_levels
from netboard.base.errors import ConfigError

Array = NDArray[np.float64]

Scale = Literal["difference", "ratio"]

Role = Literal["primary", "secondary", "exploratory"]
"""Role of a test: as declared, or exploratory and not corrected."""

T_TEST, PERMUTATION = "paired t test", "permutation test"


@dataclass(frozen=True, slots=True)
class Differences:
    """Within-dyad differences of one contrast in all studies.

    - `unit`: unit of the effect; 1 for a ratio.
    - `scale`: kind of the effect; the differences are of natural logarithms for a ratio.
    - `gaps` (shape (studies, dyads)): difference of each dyad, NaN without one [unit of the measure, or 1].
    """

    measure: str
    contrast: str
    unit: str
    scale: Scale
    gaps: Array


@dataclass(frozen=True, slots=True)
class PowerRate:
    """Share of studies, with its Wilson confidence interval of 95 %.

    - `value`, `low`, `high`: the share, and the limits of its Monte Carlo error [1].
    """

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, hits: int, total: int) -> "PowerRate":
        """Return the rate of hits in a number of trials."""
        found = stats.binomtest(hits, total).proportion_ci(method="wilson")
        return cls(hits / total, float(found.low), float(found.high))

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


@dataclass(frozen=True, slots=True)
class Power:
    """Power of one test with one number of dyads.

    - `role`: of a primary test p is compared with the level as it is, of a secondary one after the gate.
    - `trials`: trials of a performer in each condition; 0 for all [1].
    - `studies`: virtual studies of this size [1].
    - `scale`: kind of the effect.
    - `effect`: mean effect in the whole cohort [unit].
    - `deviation`: standard deviation of the dyads' differences, of logarithms for a ratio; NaN for a model [unit].
    - `power`, `false_positives`: share of studies that reject the null hypothesis, with the effect and with the effect
      removed.
    - `least_p`: smallest p that the test can have; NaN for a test without a limit [1].
    - `unconverged`: share of the studies whose fit of a model did not converge [1].
    - `width`, `width_error`: mean width of the confidence interval, for a ratio the geometric mean of its upper limit
      over its lower one; and its Monte Carlo standard error [unit].
    """

    measure: str
    contrast: str
    test: str
    dyads: int
    trials: int
    studies: int
    unit: str
    scale: Scale
    effect: float
    deviation: float
    power: PowerRate
    false_positives: PowerRate
    width: float
    width_error: float
    least_p: float = nan
    unconverged: float = 0.0
    role: Role = "exploratory"

    def impossible(self, alpha: float) -> bool:
        """Return whether the test cannot reject at a level, because its smallest possible p is above it."""
        return self.least_p > alpha


@dataclass(frozen=True, slots=True)
class CohortLevels:
    """Levels of all performers of all studies, by measure: each dyad and performer (rows) in each condition (columns).

    - `who`: who performs each condition, as from `performed_by`.
    - `conditions`: a row for each condition, with its factors.
    - `studies`: number of virtual studies [1].
    - `dyads`: names of the dyads of each, in order; a row's dyad is the number of its study, from 0, and this name.
    """

    performers: Mapping[str, pd.DataFrame]
    who: Mapping[str, object]
    conditions: pd.DataFrame
    studies: int
    dyads: tuple[str, ...]

    def arranged(self, of_dyads: pd.Series) -> Array:
        """Return values of dyads in the order of studies and dyads, shape (studies, dyads); NaN for missing ones."""
        labels = [f"{number} {dyad}" for number in range(self.studies) for dyad in self.dyads]
        return np.asarray(of_dyads.reindex(labels).to_numpy().reshape(self.studies, len(self.dyads)), dtype=float)


def levels_of_cohort(frames: Iterable[pd.DataFrame], trials: int = 0) -> CohortLevels:
    """Return the levels of all performers of a cohort.

    - `frames`: table of groups of each study, with equal numbers of dyads.
    - `trials`: first trials of each condition that count, a multiple of the size of a group; 0 for all [1].
    """
    if trials % SIZE:
        raise ConfigError(f"--trials: found {trials}, expected a multiple of {SIZE}, the trials in a group")
    parts: dict[str, list[pd.DataFrame]] = {one.measure.name: [] for one in KEPT}
    who: dict[str, object] = {}
    dyads: set[str] = set()
    rows = []
    for number, frame in enumerate(frames):
        rows.append(frame.drop_duplicates("condition"))
        who |= zip(frame["condition"], zip(frame["configuration"], frame["partner"], strict=True), strict=True)
        dyads |= set(frame["dyad"])
        kept = frame[frame["group"] <= trials // SIZE] if trials else frame
        named = kept.assign(dyad=f"{number} " + kept["dyad"])
        for one in KEPT:
            parts[one.measure.name].append(performer_means(named, one))
    return CohortLevels(
        {name: pd.concat(own) for name, own in parts.items()},
        who,
        pd.concat(rows).drop_duplicates("condition"),
        len(rows),
        tuple(sorted(dyads, key=lambda dyad: int(dyad[1:]))),
    )


def differences(levels: CohortLevels, contrasts: Sequence[dict[str, object]]) -> list[Differences]:
    """Return the differences of all contrasts of all measures.

    - `contrasts`: contrasts of the report: ``name``, and the conditions ``first`` and ``second``.
    """
    found = []
    for one in KEPT:
        for contrast in contrasts:
            gaps = levels.arranged(_gaps(levels.performers[one.measure.name], levels.who, contrast))
            if np.isfinite(gaps).any():
                scale: Scale = "ratio" if one.measure.ratio else "difference"
                unit = "1" if one.measure.ratio else one.measure.unit
                found.append(Differences(one.measure.name, str(contrast["name"]), unit, scale, gaps))
    return found


def performer_means(groups: pd.DataFrame, kept: CohortMeasure) -> pd.DataFrame:
    """Return the level of each dyad and performer (rows) in each condition (columns)."""
    value, weight = kept.value(groups), groups[kept.weight]
    known = np.isfinite(value) & (weight > 0)
    table = groups.loc[known, ["dyad", "performer", "condition"]].assign(sum=value * weight, weight=weight)
    sums = table.groupby(["dyad", "performer", "condition"])[["sum", "weight"]].sum()
    return (sums["sum"] / sums["weight"]).unstack("condition")


def _gaps(performers: pd.DataFrame, who: Mapping[str, object], contrast: Mapping[str, object]) -> pd.Series:
    """Return the difference of each dyad that has both conditions; each of them may be a difference of two."""
    first, second = (list(contrast[place]) for place in ("first", "second"))  # type: ignore[call-overload]
    if not {*first, *second} <= set(performers):
        return pd.Series(dtype=np.float64)
    levels = paired_levels(performers, who, [*first, *second])
    one, other = (levels[own[0]] - (levels[own[1]] if len(own) > 1 else 0.0) for own in (first, second))
    return one - other


def divided(gaps: Array, dyads: int) -> Array:
    """Divide studies into studies of fewer dyads; dyads that are left over do not count.

    - returns (shape (n, dyads)): differences of the dyads of each.
    """
    whole = gaps.shape[1] // dyads
    return np.asarray(gaps[:, : whole * dyads].reshape(-1, dyads))


def powers(found: Sequence[Differences], sizes: Sequence[int], alpha: float = 0.05, trials: int = 0) -> Iterator[Power]:
    """Yield the power of both tests of each contrast with each number of dyads."""
    rng = np.random.default_rng(SEED)
    for one in found:
        mean, deviation = float(np.nanmean(one.gaps)), float(np.nanstd(one.gaps, ddof=1))
        effect = float(np.exp(mean)) if one.scale == "ratio" else mean
        for dyads in sizes:
            own = divided(one.gaps, dyads)
            null = without_effect(own, mean)
            p, low, high = paired_t_tests(own, alpha)
            tests = {
                T_TEST: (p, paired_t_tests(null, alpha)[0]),
                PERMUTATION: (permutation_p(own, rng=rng), permutation_p(null, rng=rng)),
            }
            for test, (with_effect, without) in tests.items():
                width, error = mean_width(high - low, one.scale)
                yield Power(
                    measure=one.measure,
                    contrast=one.contrast,
                    test=test,
                    dyads=dyads,
                    trials=trials,
                    studies=len(own),
                    unit=one.unit,
                    scale=one.scale,
                    effect=effect,
                    deviation=deviation,
                    power=PowerRate.of(int((with_effect <= alpha).sum()), len(own)),
                    false_positives=PowerRate.of(int((without <= alpha).sum()), len(own)),
                    width=width,
                    width_error=error,
                    least_p=least_permutation_p(dyads) if test == PERMUTATION else nan,
                )


def without_effect(gaps: Array, mean: float) -> Array:
    """Return the differences of each study minus the cohort's mean; 0 where those of a study are all equal.

    - `gaps` (shape (studies, dyads)): difference of each dyad [any].
    """
    return np.where(all_equal(gaps)[:, None], 0.0 * gaps, gaps - mean)


def all_equal(gaps: Array) -> NDArray[np.bool_]:
    """Return whether the known differences of each study are equal but for rounding, as `constant` does for one.

    - `gaps` (shape (studies, dyads)): difference of each dyad; NaN are ignored [any].
    """
    known = np.isfinite(gaps)
    largest, smallest = np.where(known, gaps, -np.inf).max(axis=1), np.where(known, gaps, np.inf).min(axis=1)
    return np.asarray(largest - smallest <= ROUNDING * np.maximum(np.abs(largest), np.abs(smallest)))


def paired_t_tests(gaps: Array, alpha: float) -> tuple[Array, Array, Array]:
    """Return p of the paired t test of many studies, and the limits of the confidence interval of 1 - alpha.

    As in an analysis, there is no p for fewer than two differences, or if all are equal.

    - `gaps` (shape (studies, dyads)): difference of each dyad; NaN are ignored [any].
    """
    known = np.isfinite(gaps)
    n = known.sum(axis=1)
    values = np.where(known, gaps, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = values.sum(axis=1) / n
        spread = np.where(known, gaps - mean[:, None], 0.0)
        error = np.sqrt((spread**2).sum(axis=1) / (n - 1) / n)
        p = 2.0 * stats.t.sf(np.abs(mean) / error, n - 1)
        half = stdtrit(np.maximum(n - 1, 1), 1.0 - alpha / 2.0) * error
    return np.where((n > 1) & ~all_equal(gaps), p, nan), mean - half, mean + half


def mean_width(widths: Array, scale: Scale) -> tuple[float, float]:
    """Return the mean width, and its Monte Carlo standard error; NaN with fewer than two finite widths.

    - `widths` (shape (n,)): widths of the confidence intervals, of logarithms for a ratio [any].
    """
    known = widths[np.isfinite(widths)]
    if len(known) < 2:
        return nan, nan
    mean, error = float(known.mean()), float(known.std(ddof=1) / sqrt(len(known)))
    return (mean, error) if scale == "difference" else (float(np.exp(mean)), float(np.exp(mean) * error))
