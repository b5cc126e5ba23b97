"""Was the other end moved by a person? What participants answer beside each kind of partner.

The answers are those to the question ``opinion`` of the shipped form ``person``. Two numbers describe them: the share
of answers "a person" beside each kind of partner, and the sensitivity d' with which participants distinguish people
from a kind of robot, which does not depend on how readily they answer "a person" and is 0 if they do not.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.detection import clustered_d_prime
from netboard.analysis.statistics.estimates import Estimate, mean_interval
from netboard.analysis.topics.figure import NO_EFFECT, Drawn, new_mosaic, pictured, titled
from netboard.analysis.topics.groups import estimated, interval_text
from netboard.analysis.topics.result import Result, TopicResults, plain
from netboard.base.looks import BLUE, GREY, VERMILION
from netboard.base.plural import plural
from netboard.base.tables.experiment import PERSON
from netboard.base.tables.questionnaires import PERSON_FORM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOPIC = "recognition"

OPINION = "opinion"
"""Question of the form ``person`` that asks who moved the other end."""

IS_PERSON = PERSON_FORM[OPINION].choices[0]
"""Its answer for a person."""

ROBOTS = "any robot partner"
"""Group of all kinds of robot partners together."""

_KINDS_OF_NOBODY = ("own", "still")
"""What moves the other end in blocks in which nobody else holds it."""


@dataclass(frozen=True, slots=True)
class Opinions:
    """Answers beside a kind of partner: their number, the share of "a person", and that of each dyad [1]."""

    partner: str  # ``person``, ``still`` or the name of a robot partner, or `ROBOTS`
    answers: int
    share: Estimate
    sensitivity: Estimate | None  # d' between people and this kind; None for people, and without an answer beside them
    dyads: tuple[float, ...]


def opinions(study: StudyData) -> TopicResults[Opinions]:
    """Return the answers beside each kind of partner: people first, then robot partners, then all of these together."""
    given = judgements(study.answers)
    kinds = sorted({*given["other"]} - {PERSON}, key=lambda kind: (kind in _KINDS_OF_NOBODY, kind))
    robots = [kind for kind in kinds if kind not in _KINDS_OF_NOBODY]
    groups = {kind: [kind] for kind in ([PERSON] if (given["other"] == PERSON).any() else []) + kinds}
    if len(robots) > 1:
        groups[ROBOTS] = robots
    return TopicResults.of((_opinions(given, name, own) for name, own in groups.items()), _results)


def judgements(answers: pd.DataFrame) -> pd.DataFrame:
    """Return who was taken for a person: the last answer of each participant about each block.

    Answers of bimanual blocks, in which the other hand was the participant's own, are left out.
    """
    choices = PERSON_FORM[OPINION].choices
    asked = answers[(answers["question"] == OPINION) & answers["answer"].isin(choices) & (answers["other"] != "own")]
    last = asked.drop_duplicates(["dyad", "block", "participant", "questionnaire"], keep="last")
    return last.assign(person=(last["answer"] == IS_PERSON).astype(float))


def _opinions(given: pd.DataFrame, name: str, kinds: Sequence[str]) -> Opinions:
    own = given[given["other"].isin(kinds)]
    shares = own.groupby("dyad")["person"].mean()
    sensitivity = None
    if name != PERSON and (given["other"] == PERSON).any():
        sensitivity = clustered_d_prime(_counts(given, kinds))
    return Opinions(
        name,
        len(own),
        mean_interval(shares, "share", events=float(len(own))),
        sensitivity,
        tuple(map(float, shares)),
    )


def _counts(given: pd.DataFrame, kinds: Sequence[str]) -> NDArray[np.float64]:
    """Return hits, people, false alarms and robot partners of each dyad."""
    rows = given[given["other"].isin([PERSON, *kinds])]
    signal = rows["other"] == PERSON
    parts = {
        "hits": rows["person"].where(signal, 0.0),
        "signals": signal.astype(float),
        "false_alarms": rows["person"].where(~signal, 0.0),
        "others": (~signal).astype(float),
    }
    return np.asarray(pd.DataFrame(parts).groupby(rows["dyad"]).sum().to_numpy(float))


def _results(found: Opinions) -> Iterator[Result]:
    """Yield the number of answers, the share of answers "a person", and d'."""
    dyads = found.share.n
    yield plain(TOPIC, 'answers to "was that a person?"', found.partner, float(found.answers), "1", dyads, "dyad")
    note = "mean of the dyads' shares"
    yield estimated(TOPIC, 'share of answers "a person"', found.partner, found.share, "1", note)
    if found.sensitivity is not None:
        note = "0: not distinguished; shares with the log-linear correction"
        yield estimated(TOPIC, "sensitivity d'", f"person vs {found.partner}", found.sensitivity, "1", note)


@pictured("Taken for a person")
def picture(study: StudyData) -> Drawn:
    """Draw the share of answers "a person", and the sensitivity."""
    found = opinions(study).parts
    if not found:
        return 'No participant was asked "was that a person?": the form "person" of a study\'s questionnaires asks it.'
    figure, axes = new_mosaic(1.5 + 0.35 * len(found), [["share", "sensitivity"]])
    _shares(axes["share"], found)
    titled(axes["share"], "A", "taken for a person")
    _sensitivities(axes["sensitivity"], found)
    titled(axes["sensitivity"], "B", "distinguished from people")
    return figure, _caption(found)


def _rows(axes: "Axes", found: Sequence[Opinions]) -> None:
    """Name the partners of the rows, from top to bottom."""
    axes.set_yticks(range(len(found)), [one.partner for one in found])
    axes.set_ylim(len(found) - 0.5, -0.5)


def _bar(axes: "Axes", at: int, estimate: Estimate, colour: str) -> None:
    """Draw an estimate with its interval."""
    if np.isfinite(estimate.low):
        axes.plot([estimate.low, estimate.high], [at, at], color=colour, linewidth=1.2, label="_interval")
    axes.plot([estimate.value], [at], "o", color=colour, markersize=5, label="_estimate")


def _shares(axes: "Axes", found: Sequence[Opinions]) -> None:
    axes.axvline(0.5, **NO_EFFECT)
    for at, one in enumerate(found):
        axes.plot(one.dyads, [at] * len(one.dyads), "o", color=GREY, markersize=2, alpha=0.6, label="_dyads")
        _bar(axes, at, one.share, VERMILION if one.partner == PERSON else BLUE)
    _rows(axes, found)
    axes.set_xlabel('share of answers "a person" [1]')
    axes.set_xlim(-0.03, 1.03)


def _sensitivities(axes: "Axes", found: Sequence[Opinions]) -> None:
    axes.axvline(0.0, **NO_EFFECT)
    for at, one in enumerate(found):
        if one.sensitivity is not None and np.isfinite(one.sensitivity.value):
            _bar(axes, at, one.sensitivity, BLUE)
    _rows(axes, found)
    axes.set_xlabel("sensitivity d' [1]")


def _caption(found: Sequence[Opinions]) -> str:
    estimates = [one.share for one in found] + [one.sensitivity for one in found if one.sensitivity is not None]
    counts = ", ".join(f"{one.partner} {plural(one.answers, 'answer')}" for one in found)
    dyads = plural(max(one.share.n for one in found), "dyad")
    return (
        f"What participants of {dyads} answered after a block to the question who moved the other end ({counts}). A: "
        'share of answers "a person": large points are means over dyads, small points dyads; the line is at 0.5. B: '
        "sensitivity d' between people and each partner; the line is at 0, where they are not distinguished. Bars: "
        f"{interval_text(estimates)}."
    )
