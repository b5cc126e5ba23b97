"""Response to a push in perturbation trials: how far ball, board or stylus goes, and how soon it is half-way back.

The course of a perturbation trial is compared with the mean course of the same performer's trials without a push, both
from the moment at which the push begins, or would begin. The deviation is + in the direction of the push, whatever its
sign. Attempts that end within the window shown are left out, of either kind: a push that makes the ball fall at once
is not in the response.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.exclusions import PERTURBED
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import ATTEMPT_KEY
from netboard.analysis.measures.pushes import PushResponse, push_response
from netboard.analysis.statistics.estimates import Estimate, t_interval
from netboard.analysis.topics.figure import NO_EFFECT, Drawn, look_of, new_mosaic, pictured, titled
from netboard.analysis.topics.groups import Condition, comparisons, conditions, estimated
from netboard.analysis.topics.measures import legend
from netboard.analysis.topics.paths import PERIOD
from netboard.analysis.topics.result import Result, TopicResults, cached
from netboard.analysis.topics.units import read_in
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "pushes"

SECONDS = 2.0
"""Window after the onset of a push [s]."""

TIMES = np.arange(round(SECONDS / PERIOD) + 1) * PERIOD
"""Times of a deviation after the onset [s]."""

LEAST = 3
"""Fewest trials of either kind of a performer in a condition [1]."""

QUANTITIES = {
    "peak displacement": ("m", "peak"),
    "time of the peak displacement": ("s", "at"),
    "time until half-way back": ("s", "half_back"),
}
"""Reported quantities, each with its unit and its attribute of `PushResponse`."""


@dataclass(frozen=True, slots=True, eq=False)
class Pushed:
    """Responses of performers to a push, with their mean deviation at `TIMES`, + = in the push's direction [m]."""

    condition: Condition
    place: str  # ``ball``, ``board``, ``left`` or ``right``
    performers: tuple[tuple[str, str], ...]  # dyad and performer of each row
    deviations: NDArray[np.float64]
    responses: tuple[PushResponse, ...]
    trials: int

    def values(self, quantity: str) -> pd.Series:
        """Return a quantity of each performer."""
        index = pd.MultiIndex.from_tuples(self.performers, names=["dyad", "performer"])
        return pd.Series([getattr(one, QUANTITIES[quantity][1]) for one in self.responses], index, dtype=float)

    def estimate(self, quantity: str) -> Estimate:
        """Return the mean of a quantity over dyads, of its performers' mean each."""
        return t_interval(self.values(quantity).groupby("dyad").mean())


@cached
def pushes(study: StudyData) -> TopicResults[Pushed]:
    """Return the responses to pushes of each condition, and their differences between conditions."""
    every = conditions(study)
    parts = [one for condition in every for one in _pushed(condition, study)]
    found: TopicResults[Pushed] = TopicResults.of(parts, _results)
    return TopicResults(found.parts, (*found.results, *_differences(every, parts)))


def _pushed(condition: Condition, study: StudyData) -> Iterator[Pushed]:
    """Yield the responses in a condition, by the place of the push."""
    own = study.trials[(study.trials["condition"] == condition.name) & study.trials["push_onset"].notna()]
    own = own[~pd.MultiIndex.from_frame(own[ATTEMPT_KEY]).isin(_flawed(study))]
    long_enough = own["duration"] - own["push_onset"] > SECONDS + PERIOD
    for place, rows in own[long_enough].groupby("pushed"):
        deviations = {who: _deviations(group, study.paths, str(place)) for who, group in rows.groupby(_WHO)}
        known = {(str(dyad), str(who)): each for (dyad, who), each in deviations.items() if len(each)}
        if known:
            means = np.array([each.mean(axis=0) for each in known.values()])
            responses = tuple(push_response(mean, 1.0 / PERIOD) for mean in means)
            count = sum(map(len, known.values()))
            yield Pushed(condition, str(place), tuple(known), means, responses, count)


_WHO = ["dyad", "performer"]


def _flawed(study: StudyData) -> pd.MultiIndex:
    """Return the attempts that are excluded for another reason than their perturbation."""
    reasons = study.exclusions[study.exclusions["why"] != PERTURBED]
    return pd.MultiIndex.from_frame(reasons[ATTEMPT_KEY])


def _deviations(rows: pd.DataFrame, paths: Mapping[str, pd.DataFrame], place: str) -> NDArray[np.float64]:
    """Return the deviation of each perturbation trial of a performer; none if there are too few trials [m]."""
    push = rows["perturbation"].to_numpy() != 0.0
    others = (rows["counts"] == 1).to_numpy() & ~push
    courses = _courses(rows, paths, place)
    known = np.isfinite(courses).all(axis=1)
    push, others = push & known, others & known
    if min(push.sum(), others.sum()) < LEAST:
        return np.empty((0, len(TIMES)))
    signs = np.sign(rows["perturbation"].to_numpy()[push])
    return np.asarray(signs[:, None] * (courses[push] - courses[others].mean(axis=0)))


def _courses(rows: pd.DataFrame, paths: Mapping[str, pd.DataFrame], place: str) -> NDArray[np.float64]:
    """Return where that which is pushed is after the onset, from where it was then; NaN without a path [m]."""
    found = np.full((len(rows), len(TIMES)), np.nan)
    by_recording = {name: dict(list(paths[name].groupby(["trial", "attempt"]))) for name in rows["recording"].unique()}
    columns = ["recording", "trial", "attempt", "push_onset", "target"]
    for k, (recording, trial, attempt, onset, target) in enumerate(rows[columns].itertuples(index=False)):
        path = by_recording[recording].get((trial, attempt))
        if path is not None:
            course = np.interp(onset + TIMES, path["time"], _position(path, place, target), right=np.nan)
            found[k] = course - course[0]
    return found


def _position(path: pd.DataFrame, place: str, target: int) -> pd.Series:
    """Return the position of ball, board or stylus; that of the ball is + towards the target [m]."""
    if place == "ball":
        return path["p"] * target
    return 0.5 * (path["left_z"] + path["right_z"]) if place == "board" else path[f"{place}_z"]


def _results(one: Pushed) -> Iterator[Result]:
    """Yield the means over dyads of a condition."""
    note = f"{plural(one.trials, 'perturbation trial')}, of dyads with {LEAST} or more, and as many without a push"
    for quantity, (unit, _) in QUANTITIES.items():
        yield estimated(TOPIC, _named(quantity, one.place), one.condition.label, one.estimate(quantity), unit, note)


def _named(quantity: str, place: str) -> str:
    where = f"the {place} stylus" if place in ("left", "right") else f"the {place}"
    return f"{quantity} after a push at {where}"


def _differences(every: tuple[Condition, ...], parts: Sequence[Pushed]) -> Iterator[Result]:
    """Yield the differences between conditions within dyads, such as haptics on minus haptics off."""
    for place in dict.fromkeys(one.place for one in parts):
        own = {one.condition.name: one for one in parts if one.place == place}
        among = tuple(condition for condition in every if condition.name in own)
        for quantity, (unit, _) in QUANTITIES.items():
            values = {name: one.values(quantity) for name, one in own.items()}
            for group, differences in comparisons(among, values) if len(among) > 1 else ():
                found = t_interval(differences)
                yield estimated(TOPIC, f"{_named(quantity, place)}: difference", group, found, unit)


@pictured("Response to a push")
def picture(study: StudyData) -> Drawn:
    """Draw the mean deviation after a push."""
    found = pushes(study).parts
    if not found:
        return f"No performer has {LEAST} perturbation trials and {LEAST} others that last {SECONDS:g} s after it."
    places = list(dict.fromkeys(one.place for one in found))
    figure, axes = new_mosaic(3.6, [places])
    for letter, place in zip("ABCD", places, strict=False):
        for one in (one for one in found if one.place == place):
            _draw(axes[place], one)
        axes[place].axhline(0.0, **NO_EFFECT)
        axes[place].set_xlabel("time after the onset of the push [s]")
        titled(axes[place], letter, f"push at the {place}")
    axes[places[0]].set_ylabel("displacement [mm]")
    legend(figure, tuple(dict.fromkeys(one.condition for one in found)), "outside lower center")
    return figure, _caption(found)


def _draw(axes: "Axes", one: Pushed) -> None:
    """Draw the mean over dyads, and its interval at each time."""
    look, scale = look_of(one.condition), read_in("m").scale
    dyads = pd.DataFrame(one.deviations).groupby([dyad for dyad, _ in one.performers]).mean()
    each = [t_interval(dyads[k]) for k in dyads]
    low, mean, high = (np.array([getattr(point, name) for point in each]) for name in ("low", "value", "high"))
    name = f"{one.condition.name}, {one.place}"
    axes.plot(TIMES, scale * mean, color=look.colour, linestyle=look.line, linewidth=1.2, label=f"_{name}")
    if np.isfinite(low).all():
        axes.fill_between(
            TIMES, scale * low, scale * high, color=look.colour, alpha=0.15, linewidth=0, label=f"_band {name}"
        )


def _caption(found: Sequence[Pushed]) -> str:
    counts = ", ".join(f"{one.condition.label}, {one.place}: {plural(one.trials, 'trial')}" for one in found)
    dyads = plural(max(one.estimate("peak displacement").n for one in found), "dyad")
    return (
        f"Mean deviation of {dyads} from their trials without a push, + in the direction of the push; bands: 95 % t "
        f"intervals over dyads. Perturbation trials: {counts}."
    )
