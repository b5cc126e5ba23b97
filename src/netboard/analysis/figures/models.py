"""Models of all trials: terms with confidence intervals, and normality of residuals.

The models come from `netboard.analysis.results.models`; those without a fit are named in the caption.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import BLACK, ORANGE, SKY, Picture
from netboard.analysis.figures.marks import Look, beside, draw_mean, many, new_mosaic, styled_whole, titled
from netboard.analysis.results.models import Fit, Fits, fits
from netboard.analysis.statistics.effects import Effect

TITLE = "Models of all trials"

LOOKS = {
    "completion time": Look(BLACK, "o", BLACK, "-"),
    "velocity peaks": Look(ORANGE, "s", ORANGE, "-"),
    "falls per attempt": Look(SKY, "D", SKY, "-"),
}
"""Style of each model."""


@styled_whole
def picture(study: Study) -> Picture:
    """Draw the models."""
    found = fits(study)
    shown = [one for one in found.fits if one.model.fitted]
    if not any(factors_of(one) for one in shown):
        why = "; ".join(f"{one.measure}: {', '.join(one.model.notes)}" for one in found.fits)
        none = "No model has conditions to tell apart" if shown else "No model could be fitted"
        return Picture("models", TITLE, f"{none}. {why[:1].upper()}{why[1:]}.", None)
    checked = [one for one in shown if one.model.diagnostics is not None]
    figure, axes = new_mosaic(
        3.4, [["terms", "residuals"]] if checked else [["terms"]], width_ratios=[1.5, 1][: 1 + bool(checked)]
    )
    _terms(axes["terms"], shown)
    titled(axes["terms"], "A", "factors")
    if checked:
        _residuals(axes["residuals"], checked[0])
        titled(axes["residuals"], "B", f"residuals, {checked[0].measure}")
    return Picture("models", TITLE, _caption(found, shown), figure)


def factors_of(fit: Fit) -> list[Effect]:
    """Return the estimable terms that are ratios of conditions."""
    others = ("intercept", "log trial")
    return [one for one in fit.model.effects if one.name not in others and np.isfinite(one.ratio.value)]


def _terms(axes: Axes, shown: Sequence[Fit]) -> None:
    """Draw the ratios of all models, a row for each term."""
    names = list(dict.fromkeys(effect.name for fit in shown for effect in factors_of(fit)))
    axes.axvline(1.0, color="#888888", linewidth=0.8, zorder=1)
    for fit, offset in zip(shown, beside(len(shown), 0.4), strict=True):
        look = LOOKS[fit.measure]
        for effect in factors_of(fit):
            label = f"{fit.measure}: {effect.name}"
            draw_mean(axes, names.index(effect.name) + offset, effect.ratio, look, label, across=True)
        axes.plot([], [], linestyle="none", marker=look.marker, color=look.colour, label=f"{fit.measure}, {fit.ratio}")
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if high < 30 * low else (1.0,)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(axis="x", labelsize=7)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("ratio [1]")
    axes.legend(loc="upper center", bbox_to_anchor=(0.4, -0.14), ncols=1, fontsize=7)


def _residuals(axes: Axes, fit: Fit) -> None:
    """Draw a normal Q-Q plot of the residuals."""
    found = fit.model.diagnostics
    if found is None:
        return
    ends = [float(found.quantiles[0]), float(found.quantiles[-1])]
    axes.plot(ends, ends, color="#888888", linewidth=0.8, label="_normal")
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


def _caption(found: Fits, shown: Sequence[Fit]) -> str:
    fitted = "; ".join(
        f"{one.measure}: {one.model.name}, {one.model.trials} {one.of}s of {many(one.model.dyads, 'dyad')}"
        for one in shown
    )
    failed = "".join(
        f" No model of {one.measure}: {'; '.join(one.model.notes)}." for one in found.fits if not one.model.fitted
    )
    left = f" {'; '.join(found.notes)}." if found.notes else ""
    return (
        "A: ratios by which a factor multiplies the response (of falls: the odds), over the other factor, and haptics "
        "in each configuration; bars: 95 % intervals with one degree of freedom less than dyads. B: residuals in order "
        f"of size. {fitted[0].upper()}{fitted[1:]}.{failed}{left}"
    )
