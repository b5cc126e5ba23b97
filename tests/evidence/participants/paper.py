"""The paper's reported results, as statements about the trials of one study of a few dyads.

A statement has a value if the paper prints one, and a direction if it reports one. The paper prints no numbers for
shares, ellipses and most delays. Its wording is interpreted as in the analysis: first and last trials are counted
within configuration and haptic condition, both conditions are pooled, and standard deviations are over single trials.
Delays are searched for within the movement of the board, as the paper more likely did ("Which search?" in
`docs/reference/measures.md`), and are means over both haptic conditions where the paper does not name one.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.inference.summaries import EACH_END, QUANTITIES, End, reported
from netboard.analysis.measures.ellipses import ellipse
from netboard.analysis.measures.performance import relative_performance, running_number
from netboard.analysis.topics.delay import OVER_ALL

Configuration = Literal["bimanual", "dyadic"]

CONFIGURATIONS: tuple[Configuration, ...] = ("bimanual", "dyadic")

GROUPS = 6
"""Number of groups of trials in a condition; the paper draws an ellipse of each [1]."""

DYADS = 4
"""Number of dyads of the paper [1]."""

END_SHARE = 1 / 6
"""Share of the first and of the last trials in a condition: 30 of 180 [1]."""


class Sample:
    """The successful trials of some dyads.

    - `attempts` (array of ATTEMPT): attempts of each dyad in the order of the plan.
    """

    def __init__(self, attempts: NDArray[Any]) -> None:
        self.rows = attempts[attempts["success"]]
        self.dyads = np.unique(self.rows["dyad"])

    @cached_property
    def _share(self) -> NDArray[np.float64]:
        """Place of each trial among those of its performer and haptic condition, above 0 to 1 [1]."""
        order = running_number(self._whose)
        return np.asarray(order / np.bincount(self._whose)[self._whose])

    @cached_property
    def _whose(self) -> NDArray[np.int64]:
        """Number of the performer and haptic condition of each trial [1]."""
        labels = [np.unique(self.rows[name], return_inverse=True)[1] for name in ("dyad", "performer", "haptics")]
        return np.asarray(np.unique(np.stack(labels), axis=1, return_inverse=True)[1].ravel())

    @cached_property
    def _masks(self) -> dict[tuple[Configuration, bool | None], NDArray[np.bool_]]:
        together, on = self.rows["performer"] == "dyad", self.rows["haptics"]
        every = np.ones(len(on), bool)
        which: dict[Configuration, NDArray[np.bool_]] = {"bimanual": ~together, "dyadic": together}
        forces: dict[bool | None, NDArray[np.bool_]] = {None: every, True: on, False: ~on}
        return {(name, haptics): one & other for name, one in which.items() for haptics, other in forces.items()}

    def of(self, name: str, configuration: Configuration, haptics: bool | None = None) -> NDArray[Any]:
        """Return a column of the trials of a condition."""
        return np.asarray(self.rows[name][self._masks[configuration, haptics]])

    def end(self, name: str, configuration: Configuration, which: End) -> NDArray[Any]:
        """Return a column of the first or last trials of a configuration, both haptic conditions pooled."""
        share = self._share[self._masks[configuration, None]]
        return self.of(name, configuration)[share <= END_SHARE if which == "first" else share > 1 - END_SHARE]

    def better(self, name: str, haptics: bool, *, alone: bool | None = None) -> int:
        """Count the dyads that are better than the mean of their two participants alone; ``alone``: as in `levels`."""
        levels = [self.levels(name, dyad, haptics, alone=alone) for dyad in self.dyads]
        return sum(relative_performance(*three).gain > 0 for three in levels)

    def levels(self, name: str, dyad: int, haptics: bool, *, alone: bool | None = None) -> tuple[float, float, float]:
        """Return the means of both participants alone and of the dyad in a haptic condition.

        ``alone``: the haptic condition of the participants alone; by default that of the dyad.
        """
        own = haptics if alone is None else alone
        mine = self.rows[self.rows["dyad"] == dyad]
        a, b, both = (
            float(np.mean(mine[name][(mine["performer"] == who) & (mine["haptics"] == on)]))
            for who, on in (("A", own), ("B", own), ("dyad", haptics))
        )
        return a, b, both

    def gain(self, name: str, haptics: bool, *, alone: bool | None = None) -> float:
        """Return the mean over dyads of the logarithm of the dyad's level over the mean of its two participants [1]."""
        levels = [self.levels(name, dyad, haptics, alone=alone) for dyad in self.dyads]
        return float(np.mean([np.log(2.0 * both / (a + b)) for a, b, both in levels]))

    def haptic_effects(self, configuration: Configuration) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Return for each performer whether haptic feedback was on in the first block, and its effect.

        The effect is the logarithm of the mean completion time with haptic feedback over that without it [1].
        """
        trials = self.rows[self._masks[configuration, None]]
        began_on, effects = [], []
        for dyad, performer in np.unique(trials[["dyad", "performer"]]):
            own = trials[(trials["dyad"] == dyad) & (trials["performer"] == performer)]
            on, off = (float(own["completion"][own["haptics"] == haptics].mean()) for haptics in (True, False))
            began_on.append(bool(own["haptics"][np.argmin(own["block"])]))
            effects.append(np.log(on / off))
        return np.array(began_on), np.array(effects)

    def delay(
        self, configuration: Configuration, haptics: bool, portion: int | None = None, *, back: bool = False
    ) -> float:
        """Return the mean absolute delay at one portion of the peak, or of all portions [s].

        ``back``: a side is searched for before the movement of the board, too.
        """
        names = ("delay_back", "delays_back") if back else ("delay", "delays")
        total, count = (self.of(name, configuration, haptics).sum(axis=0) for name in names)
        means = total / np.maximum(count, 1)
        return float(means.mean() if portion is None else means[portion])

    def spread(self, configuration: Configuration, measure: Callable[[NDArray[np.float64]], float]) -> float:
        """Return a measure of the strategies in the last group over that in the first, as a logarithm [1].

        Each performer and haptic condition has the same weight.
        """
        chosen = self._masks[configuration, None]
        points = np.stack([self.rows[name][chosen] for name in ("distance", "velocity")], axis=1)
        group, whose = np.ceil(self._share[chosen] * GROUPS - 1e-9), self._whose[chosen]
        means = []
        for number in (1, GROUPS):
            each = np.array([measure(points[(group == number) & (whose == one)]) for one in np.unique(whose)])
            known = each[np.isfinite(each)]
            means.append(float(known.mean()) if len(known) else float("nan"))
        return float(np.log(means[1] / means[0]))


@dataclass(frozen=True)
class Statement:
    """One reported result.

    - `value`: the printed value; None without one.
    - `sense`: reported direction of the quantity: +1 above zero, -1 below; 0 without one [1].
    - `adjusted`: whether the last adjustment of the default parameters used it.
    - `fitted`: whether the fit of the posterior used it.
    - `largest`: the largest value that it can have; None without a limit.
    """

    name: str
    of: Callable[[Sample], float]
    value: float | None = None
    sense: int = 0
    adjusted: bool = False
    fitted: bool = False
    largest: float | None = None


Quantity = Callable[[Sample], float]


def _minus(one: Quantity, other: Quantity) -> Quantity:
    return lambda sample: one(sample) - other(sample)


def _end(
    name: str, configuration: Configuration, which: End, summary: Callable[[NDArray[Any]], Any] = np.mean
) -> Quantity:
    return lambda sample: float(summary(sample.end(name, configuration, which)))


def _ends() -> Iterator[Statement]:
    """Completion times and numbers of peaks of the first and last trials."""
    labels = {"completion": "completion time [s]", "peaks": "velocity peaks"}
    for name, configuration in product(labels, CONFIGURATIONS):
        text, alone = f"{labels[name]}, {configuration}", configuration == "bimanual"
        for which in EACH_END:
            printed = reported(QUANTITIES[name], f"{configuration}, {which} {{ends}}")
            mean, spread = (_end(name, configuration, which, of) for of in (np.mean, partial(np.std, ddof=1)))
            yield Statement(f"{text}, {which} 30", mean, printed.reported, adjusted=alone, fitted=alone)
            # The adjustment did not use the standard deviation of the peaks.
            times = alone and name == "completion"
            yield Statement(f"{text}, {which} 30, SD", spread, printed.reported_sd, adjusted=times, fitted=alone)
        learned = _minus(_end(name, configuration, "last"), _end(name, configuration, "first"))
        yield Statement(f"{text}, last - first", learned, sense=-1, adjusted=alone, fitted=alone)


def _share(name: str, configuration: Configuration, haptics: bool | None = None) -> Quantity:
    """Return the mean share of a movement class."""
    return lambda sample: float(np.nanmean(sample.of(name, configuration, haptics)))


def _shares() -> Iterator[Statement]:
    """Shares of the movement classes: the paper prints only directions."""
    for name, sense in (("cooperative", -1), ("still", -1), ("single", 1), ("competitive", 1)):
        of = _minus(_share(name, "dyadic"), _share(name, "bimanual"))
        yield Statement(f"{name} share, dyadic - bimanual", of, sense=sense)
    effects: tuple[tuple[str, Configuration, int], ...] = (
        ("cooperative", "bimanual", 1),
        ("cooperative", "dyadic", 1),
        ("single", "bimanual", -1),
        ("single", "dyadic", -1),
        ("competitive", "dyadic", -1),
    )
    for name, configuration, sense in effects:
        of = _minus(_share(name, configuration, True), _share(name, configuration, False))
        yield Statement(f"{name} share, {configuration}, haptics on - off", of, sense=sense)


def _dyads() -> Iterator[Statement]:
    """Dyads that are better than the mean of their participants, of four."""
    for (name, word), on in product((("completion", "faster"), ("peaks", "smoother")), ("on", "off")):
        printed = reported(f"{QUANTITIES[name]}: dyads better than the mean of the two", f"haptics {on}").reported
        of = partial(Sample.better, name=name, haptics=on == "on")
        yield Statement(f"dyads {word} than alone, haptics {on}", of, round(printed), largest=DYADS)


def _variance(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.var(known, ddof=1)) if len(known) > 1 else float("nan")


def _strategies() -> Iterator[Statement]:
    """Convergence of the strategies: ellipses shrink, variances fall."""
    measures: dict[str, Callable[[NDArray[np.float64]], float]] = {
        "ellipse area": lambda points: ellipse(points).area,
        "variance of distance": lambda points: _variance(points[:, 0]),
        "variance of velocity": lambda points: _variance(points[:, 1]),
    }
    for (text, how), one in product(measures.items(), CONFIGURATIONS):
        of = partial(Sample.spread, configuration=one, measure=how)
        yield Statement(f"{text}, {one}, log(last/first)", of, sense=-1)


def _delay(configuration: Configuration, haptics: bool, portion: int | None = None, *, back: bool = False) -> Quantity:
    return lambda sample: 1e3 * sample.delay(configuration, haptics, portion, back=back)


def _pooled_delay(configuration: Configuration, *, back: bool = False) -> Quantity:
    off, on = (_delay(configuration, haptics, back=back) for haptics in (False, True))
    return lambda sample: (off(sample) + on(sample)) / 2.0


def _delays() -> Iterator[Statement]:
    """Delays between the sides, the mean of the four portions of the peak."""
    for configuration in reversed(CONFIGURATIONS):
        value, used = 1e3 * reported(f"delay, {OVER_ALL}", configuration).reported, configuration == "bimanual"
        of = _pooled_delay(configuration)
        yield Statement(f"delay [ms], {configuration}", of, value, adjusted=used, fitted=used)
        for on in (False, True):
            rising = _minus(_delay(configuration, on, -1), _delay(configuration, on, 0))
            text = f"delay [ms], {configuration}, haptics {'on' if on else 'off'}, 40 % - 10 %"
            yield Statement(text, rising, sense=1)
    alone, together = (_minus(_delay(one, True), _delay(one, False)) for one in CONFIGURATIONS)
    yield Statement("delay [ms], dyadic, haptics on - off", together, sense=-1)
    yield Statement(
        "delay [ms], haptic effect, dyadic - bimanual, absolute",
        lambda sample: abs(together(sample)) - abs(alone(sample)),
        sense=1,
    )


STATEMENTS = (*_ends(), *_shares(), *_dyads(), *_strategies(), *_delays())
"""All reported results."""


def _haptic_time_effect(sample: Sample, configuration: Configuration) -> float:
    """Return the haptic effect on the mean completion time, relative [1]."""
    on, off = (float(np.mean(sample.of("completion", configuration, haptics))) for haptics in (True, False))
    return on / off - 1.0


EXTRA = (
    *(
        Statement(f"completion time, {one}, haptics on/off - 1", partial(_haptic_time_effect, configuration=one))
        for one in CONFIGURATIONS
    ),
    *(
        Statement(
            f"completion time, log(dyad/alone), haptics {word}", partial(Sample.gain, name="completion", haptics=on)
        )
        for word, on in (("on", True), ("off", False))
    ),
    Statement(
        "completion time, log(dyad/alone with haptics off), haptics on",
        partial(Sample.gain, name="completion", haptics=True, alone=False),
    ),
    Statement(
        "dyads faster than alone with haptics off, haptics on",
        partial(Sample.better, name="completion", haptics=True, alone=False),
    ),
    *(Statement(f"delay [ms], {one}, searched back", _pooled_delay(one, back=True)) for one in CONFIGURATIONS),
)
"""Quantities that the paper does not report, for comparison."""
