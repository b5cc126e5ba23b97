"""Models of all trials: completion times, velocity peaks and falls over haptics, configuration and practice.

The models are those of `netboard.analysis.statistics.models`; this module passes a study to them and turns their terms,
notes and assumptions into results. Fixed factors are haptics (or each force, if there are several), configuration, and
every other factor that the study declares or that differs between its blocks. A numeric factor has a linear effect.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import floor, log10
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from netboard.analysis.extraction.conditions import StudyFactor
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.effects import Effect, Inference, Model
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.statistics.factors import INTERCEPT, PRACTICE, FixedFactor, paper_factors
from netboard.analysis.statistics.models import count_model, log_time_model, share_model
from netboard.analysis.statistics.random_effects import NORMAL_EFFECTS
from netboard.analysis.topics.figure import (
    NO_EFFECT,
    Drawn,
    Look,
    beside,
    draw_mean,
    new_mosaic,
    pictured,
    sentence,
    titled,
)
from netboard.analysis.topics.groups import FORCE_LABELS, haptics_of, interval_text
from netboard.analysis.topics.measures import rows_of
from netboard.analysis.topics.result import Result, cached, cautioned, plain
from netboard.base.looks import BLACK, GREY, ORANGE, PRINT_FINE, PRINT_SMALL, SKY
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True)
class ModelFit:
    """A model of a measure; `ratio` and `first` say what the exponential of a coefficient, and the intercept, mean."""

    measure: str
    of: str
    ratio: str
    first: str
    model: Model


@dataclass(frozen=True, slots=True)
class Fits:
    """All models."""

    fits: tuple[ModelFit, ...]
    notes: tuple[str, ...]

    @property
    def results(self) -> tuple[Result, ...]:
        """Return each term with its p value, the random effects, and the checks of the assumptions."""
        return tuple(row for fit in self.fits for row in (*self._terms(fit), *_random_effects(fit), *_checks(fit)))

    def _terms(self, fit: ModelFit) -> Iterator[Result]:
        note = "; ".join((f"{fit.model.name}: {fit.model.equation}", *self.notes, *fit.model.notes))
        for effect in fit.model.effects:
            yield from _rows(fit, effect, effect, "", note)
            for other in effect.others:
                yield from _rows(fit, effect, other, f", {other.method}", note)


def _rows(fit: ModelFit, effect: Effect, inference: Effect | Inference, method: str, note: str) -> Iterator[Result]:
    """Yield a term with its confidence interval, and its p value, by one method.

    A term is a factor of the response; practice is its exponent. The intercept has no p value: that the first trial
    takes 1 s, has one peak or falls as often as not is no hypothesis.
    """
    term, unit = inference.estimate if effect.name == PRACTICE else inference.ratio, "1"
    interval = f"95 % {inference.estimate.method}" if np.isfinite(term.low) else ""
    rest = (inference.estimate.n, "dyad", note)
    quantity = f"{fit.measure}: {fit.ratio}"
    if effect.name == PRACTICE:
        quantity = f"{fit.measure}: exponent of practice"
    elif effect.name == INTERCEPT:
        quantity, unit = f"{fit.measure}: {fit.first}", "s" if fit.measure == "completion time" else "1"
    yield Result("models", f"{quantity}{method}", effect.name, term.value, term.low, term.high, unit, interval, *rest)
    if effect.name != INTERCEPT:
        p = cautioned(f"{fit.measure}: p{method}", fit.model.caution)
        shape = f"{NORMAL_EFFECTS}; {note}" if effect.others else note
        yield plain("models", p, effect.name, inference.p, "1", inference.estimate.n, "dyad", shape)


def _random_effects(fit: ModelFit) -> Iterator[Result]:
    for component in fit.model.components:
        of = "trial" if component.name == "residual" else component.name.split(" by ")[-1]
        name, value = f"{fit.measure}: SD on the log scale", component.deviation
        yield plain("models", name, component.name, value, "1", component.levels, of)


def _checks(fit: ModelFit) -> Iterator[Result]:
    """Yield the diagnostic numbers with the assumptions that they check; the others are a note."""
    model = fit.model
    checks = [("correlation within dyads", model.correlation), ("Pearson's dispersion", model.dispersion)]
    if model.diagnostics is not None:
        found = model.diagnostics
        checks += [("residual skewness", found.skewness), ("residual excess kurtosis", found.kurtosis)]
        checks += [("rank correlation of residual size and fit", found.spread)]
        checks += [("correlation of successive residuals", found.successive)]
    note = " ".join(("Assumptions:", *model.assumptions))
    for name, value in checks:
        if np.isfinite(value):
            yield plain("models", f"{fit.measure}: {name}", "all", value, "1", model.trials, fit.of, note)


@cached
def fits(study: StudyData) -> Fits:
    """Fit all models without robot and still hand; one that cannot be fitted gives the reason in its notes."""
    trials, attempts = (human_test_rows(rows_of(study, of)) for of in ("trial", "attempt"))
    attempts = attempts.assign(order=trial_numbers(attempts))
    left_out = len(study.counted) - len(trials)
    notes = (f"{left_out} trials with a robot or a still hand are left out",) if left_out else ()
    return Fits(fits_of(trials, attempts, study.factors), notes)


def fits_of(
    trials: pd.DataFrame, attempts: pd.DataFrame, others: Sequence[StudyFactor], level: float = 0.95
) -> tuple[ModelFit, ...]:
    """Fit all models to trials that count and attempts with `trial_numbers`, with the study's further factors."""
    of_trials, of_attempts = _labels(trials, others), _labels(attempts, others)
    times = log_time_model(trials["completion"].where(trials["completion"] > 0.0), *of_trials, level=level)
    peaks = count_model(trials["peaks"], *of_trials, level=level)
    falls = share_model(attempts["outcome"] == "fell", *of_attempts, level=level)
    return (
        ModelFit("completion time", "trial", "ratio", "at the first trial", times),
        ModelFit("velocity peaks", "trial", "ratio", "at the first trial", peaks),
        ModelFit("falls per attempt", "attempt", "ratio of odds", "odds at the first trial", falls),
    )


def human_test_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the models: test trials without a robot or a still hand."""
    return rows[(rows["partner"] == "") & rows["role"].isin(["", "test"])]


def _labels(
    rows: pd.DataFrame, others: Sequence[StudyFactor]
) -> tuple[pd.Series, pd.Series, tuple[FixedFactor, ...], pd.Series]:
    return rows["dyad"], rows["performer"], factors_of(rows, others), rows["order"]


_COLUMNS = ("dyads", "performers", "order")
"""Names of the columns that a model has besides its factors."""


def factors_of(rows: pd.DataFrame, others: Sequence[StudyFactor] = ()) -> tuple[FixedFactor, ...]:
    """Return the fixed factors of the models: haptics, configuration, and the study's own.

    Those that haptics, configuration and partner determine are left out. A factor of the study with a name that the
    model has already is called "factor NAME".
    """
    found = list(paper_factors(rows["haptics"] == 1, rows["configuration"] == "dyadic"))
    felt = [force for force in FORCE_LABELS if force in set(rows["force"])]
    if len([force for force in felt if force != "none"]) > 1:
        found[0] = _named("haptics", rows["force"].map(haptics_of), [haptics_of(force) for force in felt])
    own = [_own(rows, one) for one in others if one.in_names]
    if own:  # with only the paper's factors, notes state what the study lacks
        found = [one for one in found if len(set(one.values)) > 1]
    taken = {*_COLUMNS, *(one.name for one in found)}
    return (*found, *(replace(one, name=f"factor {one.name}") if one.name in taken else one for one in own))


def _named(name: str, values: pd.Series, levels: Sequence[str]) -> FixedFactor:
    """Return a categorical factor; with two levels its name gives the direction of the comparison."""
    full = f"{name}: {levels[1]} vs {levels[0]}" if len(levels) == 2 else name
    return FixedFactor(full, values.to_numpy(str), tuple(levels))


def _own(rows: pd.DataFrame, factor: StudyFactor) -> FixedFactor:
    """Return a factor of the study; a numeric one has effects per decimal step of its unit that suits its range."""
    if len(set(factor.of.values)) < 2 or (rows[factor.column] == "").any():
        levels = tuple(one for one in ("", *factor.of.levels) if one in set(rows[factor.column]))
        return _named(factor.name, rows[factor.column], levels)
    step = 10.0 ** floor(log10(max(factor.of.values) - min(factor.of.values)))
    values = rows[f"{factor.column}_value"].to_numpy(float)
    return FixedFactor(factor.name, values, numeric=True, unit=factor.of.unit, step=step)


def trial_numbers(attempts: pd.DataFrame) -> pd.Series:
    """Number attempts, from 1, by the performer's trial in the condition that they belong to."""
    succeeded = (attempts["outcome"] == "success").astype("int64")
    done = succeeded.groupby([attempts[name] for name in ("dyad", "performer", "condition")]).cumsum()
    return done - succeeded + 1


LOOKS = {
    "completion time": Look(BLACK, "o", BLACK, "-"),
    "velocity peaks": Look(ORANGE, "s", ORANGE, "-"),
    "falls per attempt": Look(SKY, "D", SKY, "-"),
}
"""Style of each model."""


@pictured("Models of all trials", whole=True)
def picture(study: StudyData) -> Drawn:
    """Draw the models."""
    found = fits(study)
    shown = [one for one in found.fits if one.model.fitted]
    if not any(effects_shown(one) for one in shown):
        why = "; ".join(f"{one.measure}: {', '.join(one.model.notes)}" for one in found.fits)
        none = "No model has more than one condition" if shown else "No model could be fitted"
        return f"{none}. {sentence(why)}"
    checked = [one for one in shown if one.model.diagnostics is not None]
    figure, axes = new_mosaic(
        3.4, [["terms", "residuals"]] if checked else [["terms"]], width_ratios=[1.5, 1][: 1 + bool(checked)]
    )
    _terms(axes["terms"], found.fits)
    titled(axes["terms"], "A", "ratios of the models' terms")
    if checked:
        _residuals(axes["residuals"], checked[0])
        titled(axes["residuals"], "B", f"residuals, {checked[0].measure}")
    return figure, _caption(found, shown)


def effects_shown(fit: ModelFit) -> list[Effect]:
    """Return the estimable terms that are ratios of conditions."""
    return [one for one in fit.model.effects if one.name not in (INTERCEPT, PRACTICE) and np.isfinite(one.ratio.value)]


MOST = 100.0
"""Largest ratio on the axis, and the inverse of the smallest one [1]."""


def _terms(axes: "Axes", found: Sequence[ModelFit]) -> None:
    """Draw the ratios of all models, a row for each term; the legend names the models that cannot be estimated."""
    shown = [fit for fit in found if effects_shown(fit)]
    names = list(dict.fromkeys(effect.name for fit in shown for effect in effects_shown(fit)))
    axes.axvline(1.0, **NO_EFFECT)
    for fit, offset in zip(shown, beside(len(shown), 0.4), strict=True):
        look, effects = LOOKS[fit.measure], {one.name: one for one in effects_shown(fit)}
        for place, name in enumerate(names):
            if name in effects:
                _ratio(axes, place + offset, effects[name].ratio, look, f"{fit.measure}: {name}")
            else:
                axes.text(
                    1.0, place + offset, " cannot be estimated", va="center", fontsize=PRINT_FINE, color=look.colour
                )
        label = cautioned(f"{fit.measure}, {fit.ratio}", fit.model.caution)
        axes.plot([], [], linestyle="none", marker=look.marker, color=look.colour, label=label)
    for fit in found:
        if fit not in shown:
            axes.plot([], [], linestyle="none", label=f"{fit.measure}, {fit.ratio}: cannot be estimated")
    _ratio_axis(axes)
    axes.set_yticks(range(len(names)), names, fontsize=PRINT_SMALL)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("ratio [1]")
    axes.legend(loc="upper center", bbox_to_anchor=(0.4, -0.14), ncols=1, fontsize=PRINT_SMALL)


def _ratio(axes: "Axes", at: float, ratio: Estimate, look: Look, label: str) -> None:
    """Draw a ratio and its interval; an arrow where they go beyond the axis."""
    value, low, high = np.clip([ratio.value, ratio.low, ratio.high], 1.0 / MOST, MOST)
    draw_mean(axes, at, replace(ratio, value=value, low=low, high=high), look, label, across=True)
    for beyond, limit, marker in ((ratio.low < 1.0 / MOST, 1.0 / MOST, "<"), (ratio.high > MOST, MOST, ">")):
        if beyond:
            axes.plot([limit], [at], marker=marker, color=look.colour, markersize=5, label=f"_{label}, beyond")


def _ratio_axis(axes: "Axes") -> None:
    """Make the axis logarithmic, with ticks that suit its range."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if high < 3 * low:
        axes.xaxis.set_major_locator(MaxNLocator(6))
    else:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if high < 30 * low else (1.0,)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(axis="x", labelsize=7)


def _residuals(axes: "Axes", fit: ModelFit) -> None:
    """Draw a normal Q-Q plot of the residuals."""
    found = fit.model.diagnostics
    if found is None:
        return
    ends = [float(found.quantiles[0]), float(found.quantiles[-1])]
    axes.plot(ends, ends, color=GREY, linewidth=0.8, label="_normal")
    axes.plot(
        found.quantiles,
        found.residuals,
        ".",
        color=LOOKS[fit.measure].colour,
        markersize=2,
        rasterized=True,
        label="_residuals",
    )
    axes.set_xlabel("normal quantile [SD]")
    axes.set_ylabel("residual [SD]")


def _caption(found: Fits, shown: Sequence[ModelFit]) -> str:
    fitted = "; ".join(
        cautioned(
            f"{one.measure}: {one.model.name}, {one.model.trials} {one.of}s of {plural(one.model.dyads, 'dyad')}",
            one.model.caution,
        )
        for one in shown
    )
    failed = "".join(
        f" Model of {one.measure}: {'; '.join(_why(one.model))}." for one in found.fits if not one.model.fitted
    )
    left = f" {'; '.join(found.notes)}." if found.notes else ""
    checked = " B: residuals of the first model in order of size." if shown[0].model.diagnostics is not None else ""
    return (
        "A: the ratio by which a term multiplies the response; for falls it multiplies the odds. A factor alone, such "
        "as haptics (on vs off) or configuration (dyadic vs bimanual), is averaged over the levels of all other "
        "factors. A factor and a level, such as haptics, dyadic: the effect of the factor at that level. A product "
        f"(x): the ratio of two such effects. Bars: {_intervals(shown)}{_beyond(shown)}.{checked} "
        f"{sentence(fitted)}{failed}{left}"
    )


def _why(model: Model) -> list[str]:
    """Return why a model is not fitted, without the notes on its terms."""
    return [note for note in model.notes if note.startswith("not ")] or list(model.notes)


def _intervals(shown: Sequence[ModelFit]) -> str:
    return interval_text(effect.ratio for fit in shown for effect in effects_shown(fit))


def _beyond(shown: Sequence[ModelFit]) -> str:
    """Return what an arrow means, if there is one."""
    ends = [end for fit in shown for one in effects_shown(fit) for end in (one.ratio.low, one.ratio.high)]
    if not any(end < 1.0 / MOST or end > MOST for end in ends):
        return ""
    return f"; arrow: the interval goes beyond {1.0 / MOST:g} or {MOST:g}"
