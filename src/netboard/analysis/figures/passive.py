"""Effect of haptic feedback on cooperative movement, compared with the passive-partner effect.

The passive effect is shown without friction, an upper bound, and with the device's friction if it is known. The numbers
come from `netboard.analysis.results.passive_partner`.
"""

import numpy as np

from netboard.analysis.extraction.study import Study
from netboard.analysis.figures.figure import Picture
from netboard.analysis.figures.marks import beside, draw_dyads, draw_mean, look_of, many, new_mosaic, styled
from netboard.analysis.results.passive_partner import Control, controls
from netboard.analysis.results.units import PERCENT, POINTS

_NONE = "What part of the effect is mechanics cannot be told: the effect may be 0."

TITLE = "How much of it a passive partner would show"


@styled
def picture(study: Study) -> Picture:
    """Draw the effect of haptic feedback and the passive effect."""
    found = controls(study).controls
    if not found:
        why = "No dyad has trials of two people both with and without forces, in a scene with a free board."
        return Picture("passive", TITLE, why, None)
    figure, panels = new_mosaic(3.0, [["all"]])
    axes = panels["all"]
    axes.axhline(0.0, color="#888888", linewidth=0.8, zorder=1)
    felt = list(dict.fromkeys(one.condition for one in found))
    columns = list(range(1 + len({one.arm for one in found})))
    for condition, offset in zip(felt, beside(len(felt), 0.5), strict=True):
        own = [one for one in found if one.condition == condition]
        look = look_of(condition)
        for k, dyad in enumerate(own[0].dyads):
            values = [own[0].effect[k], *(one.passive[k] for one in own)]
            draw_dyads(
                axes,
                np.array(columns) + offset + 0.06,
                POINTS.scale * np.array(values),
                look.colour,
                f"{condition.name}, {dyad}",
                joined=True,
            )
        means = [own[0].mean_effect, *(one.mean_passive for one in own)]
        for column, mean in zip(columns, means, strict=True):
            draw_mean(axes, column + offset, mean, look, f"{condition.name}, {column}", scale=POINTS.scale)
        axes.plot([], [], linestyle="none", marker=look.marker, color=look.colour, label=condition.felt)
    names = [
        "with forces less without,\nas recorded",
        *(f"passive,\n{one.arm.replace(', ', ',' + chr(10))}" for one in found if one.condition == felt[0]),
    ]
    axes.set_xticks(columns, names, fontsize=7)
    axes.set_xlim(-0.5, columns[-1] + 0.5)
    axes.set_ylabel(f"change of the cooperative share {POINTS.in_brackets}")
    if len(felt) > 1:
        axes.legend()
    return Picture("passive", TITLE, _caption(found), figure)


def _caption(found: tuple[Control, ...]) -> str:
    shares = "; ".join(_share(one) for one in found if one.has_effect)
    told = f"Part of the effect that is mechanics, with 95 % bootstrap intervals: {shares}." if shares else _NONE
    return (
        "Share of cooperative movement in dyadic trials. Left: with forces less without. Right: what either side's "
        "recorded movement gives with a passive hand, which is pushed and never acts, instead of the partner: without "
        f"friction, an upper bound, and {_device(found)}. Large "
        "points: means over dyads with 95 % t intervals; small points: dyads, joined; "
        f"n = {many(len(found[0].dyads), 'dyad')}. {told}"
    )


def _device(found: tuple[Control, ...]) -> str:
    frictions = [one.friction for one in found if one.friction]
    if not frictions:
        return "not with the device, whose friction is not known"
    return f"with the device that it held, friction {np.mean(frictions):.2f} N"


def _share(one: Control) -> str:
    value, low, high = (f"{PERCENT.scale * end:.0f}" for end in (one.share.value, one.share.low, one.share.high))
    ends = f" ({low} to {high})" if np.isfinite(one.share.low) else ""
    return f"{one.condition.felt}, {one.stiffness} N/m: {value} %{ends}"
