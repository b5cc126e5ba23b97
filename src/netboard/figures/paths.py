"""The mean course of a trial in each condition: ball and hands, with the spread of the trials."""

from matplotlib.axes import Axes

from netboard.figures.marks import look_of, new_mosaic, styled, titled
from netboard.figures.picture import Picture
from netboard.findings.paths import BAND, QUANTITIES, Course, courses
from netboard.measuring.study import Study

TITLE = "The course of a trial"

_MM = 1000.0
_STYLES = {"near": "-", "far": "--"}
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@styled
def picture(study: Study) -> Picture:
    """Draw mean paths.

    Parameters
    ----------
    study : Study
        The study.
    """
    found = courses(study).courses
    if not found:
        return Picture("paths", TITLE, "No trial that counts has a path.", None)
    shown = list(dict.fromkeys(one.condition for one in found))
    rows = [[f"{what} {one.name}" for one in shown] for what in ("ball", "hands")]
    figure, axes = new_mosaic(4.2, rows, sharex=True)
    for place, condition in enumerate(shown):
        ball, hands = (axes[f"{what} {condition.name}"] for what in ("ball", "hands"))
        for one in (one for one in found if one.condition == condition):
            _course(ball if one.quantity == "ball" else hands, one)
        titled(ball, _LETTERS[place], condition.label.replace(", ", ",\n"))
        hands.set_xlabel("time from the release [s]")
        if place:
            ball.tick_params(labelleft=False)
            hands.tick_params(labelleft=False)
    first = shown[0].name
    axes[f"ball {first}"].set_ylabel("ball towards the target [m]")
    axes[f"hands {first}"].set_ylabel("height of the hands [mm]")
    axes[f"hands {first}"].legend(loc="upper right", fontsize=6.5)
    for row in rows:
        lows, highs = zip(*(axes[name].get_ylim() for name in row), strict=True)
        for name in row:
            axes[name].set_ylim(min(lows), max(highs))
    return Picture("paths", TITLE, _caption(found), figure)


def _course(axes: Axes, one: Course) -> None:
    """Draw a quantity: each dyad, their mean, and the band of the trials."""
    look, scale = look_of(one.condition), 1.0 if one.quantity == "ball" else _MM
    name = f"{one.condition.name}, {one.quantity}"
    colour = "#555555" if one.quantity == "far" else look.colour
    axes.axhline(0.0, color="#BBBBBB", linewidth=0.6, zorder=0)
    axes.fill_between(
        one.time, scale * one.low, scale * one.high, color=colour, alpha=0.16, linewidth=0.0, label=f"_{name}, trials"
    )
    for dyad, own in zip(one.dyads, one.each, strict=True):
        axes.plot(one.time, scale * own, color=colour, linewidth=0.5, alpha=0.5, label=f"_{name}, {dyad}")
    label = f"_{name}" if one.quantity == "ball" else QUANTITIES[one.quantity]
    axes.plot(
        one.time, scale * one.mean, color=colour, linewidth=1.5, linestyle=_STYLES.get(one.quantity, "-"), label=label
    )


def _caption(found: tuple[Course, ...]) -> str:
    low, high = (round(100 * share) for share in BAND)
    known = "; ".join(
        f"{one.condition.label}: n = {len(one.dyads)} dyads, {one.trials} trials"
        for one in found
        if one.quantity == "ball"
    )
    return (
        "From the release on, the hold included; trials with the target at the left are mirrored. Thick: mean of the dyads' "
        f"means; thin: dyads; bands: from {low} % to {high} % of the trials at each time. At the end at least nine of ten "
        f"trials of the study are still going on. {known[0].upper()}{known[1:]}."
    )
