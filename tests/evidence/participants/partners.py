"""``make evidence ARGS=partners``: participants beside every kind of partner, with haptic feedback on and off.

The kinds are a participant, a hand that is held still, and all robot partners of the registry, one of which plays the
recorded hand of a participant. Each participant is another draw of the posterior that was fitted to the paper, with the
usual differences between participants; no robot was tuned with these. They perform blocks with each kind of partner, in
the left seat.

The plan, the rehearsals and the measures are those of any study, and their confidence intervals those of its report.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from evidence.participants.partner_figures import draw_beside
from netboard.analysis.cohort.block import READINGS, measured, rehearse
from netboard.analysis.cohort.posterior import read_posterior
from netboard.analysis.extraction.recordings import GROUPS
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.statistics.estimates import Estimate, t_interval
from netboard.analysis.topics.groups import CLASSES, Condition
from netboard.analysis.topics.leadership import QUESTIONS as LEADERSHIP
from netboard.analysis.topics.measures import MEASURES, Levels, Measure, exponential, levels_of
from netboard.base.config import Config, parse
from netboard.base.settings import to_toml
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.nodes.rehearsal.jobs import RehearsalJob, jobs_of
from netboard.nodes.rehearsal.jobs import rehearse as record
from netboard.participants.seat.partners import POLICIES
from netboard.task.plans.plan import blocks_of
from netboard.task.studies.study import Study, parse_study

SEED = 45
"""Seed of participants and plans [1]."""

PARTICIPANTS, QUICK_PARTICIPANTS = 10, 2
"""Participants, each beside every kind of partner [1]."""

TRIALS, QUICK_TRIALS = 8, 2
"""Successful trials in each block of a participant [1]."""

PRACTICE = 300
"""Trials, alone and together, that each participant has done before: no order of blocks has an effect [1]."""

PRACTISED = tuple(f"participant.{key}={PRACTICE}" for key in ("practice", "acquaintance", "felt_trials"))
"""Lines of the configuration that say so."""

RECORDED_TRIALS = 20
"""Trials of the recorded hand that is played [1]."""

PERSON, STILL, PLAYBACK = "person", "still", "playback"

QUICK_KINDS = (PERSON, STILL, "leader")
"""Kinds of the quick form."""

SHOWN = {PERSON: "another participant", STILL: "a hand held still", PLAYBACK: "playback of a hand"}
"""Kinds in words, if they are not robots."""


def kinds() -> tuple[str, ...]:
    """Return all kinds of partners: of the robots, all but the participant that is not drawn."""
    return (PERSON, STILL, PLAYBACK, *sorted(set(POLICIES) - {"robot", PLAYBACK}))


def shown(kind: str) -> str:
    """Return a kind in words."""
    return SHOWN.get(kind, kind)


# --- measures ----------------------------------------------------------------------------------------------------


def _idle(rows: pd.DataFrame) -> ArrayLike:
    """Return the share of the time in which the left side did not move."""
    whole = np.asarray(rows[list(CLASSES)].to_numpy(float).sum(axis=1))
    return np.where(whole > 0.0, (rows["right_only"] + rows["still"]) / np.where(whole > 0.0, whole, 1.0), np.nan)


def _share_of_work(rows: pd.DataFrame) -> ArrayLike:
    """Return the share of the left hand in the positive work of both on the board."""
    both = rows["left_given"] + rows["right_given"]
    return np.where(both > 0.0, rows["left_given"] / both.where(both > 0.0, 1.0), np.nan)


_USUAL = {one.name: one for one in (*MEASURES, *LEADERSHIP)}

OWN = (
    Measure("idle time of the participant", "1", "coordination", "trial", "share", _idle),
    Measure("effort of the participant", "N2 s", "forces", "trial", "positive", lambda rows: rows["left_effort"]),
    Measure("share of the work that is the participant's", "1", "forces", "trial", "share", _share_of_work),
    Measure(
        "attempts with a limited force",
        "1",
        "forces",
        "attempt",
        "share",
        lambda rows: rows["flags"].str.contains("clipped|saturated"),
    ),
)
"""Measures of one side, which a report does not have: its sides are both participants."""

PERFORMANCE = ("completion time", "falls per attempt", "velocity peaks")
COORDINATION = ("|delay at 20 %|", "cooperative share", "interaction force", "leadership index")

FORCES = {"full": "on", "none": "off"}
"""Force conditions, and whether haptic feedback is on in each."""


def chosen() -> tuple[Measure, ...]:
    """Return the measures of this study."""
    return (*(_USUAL[name] for name in (*PERFORMANCE, *COORDINATION)), *OWN)


# --- blocks ------------------------------------------------------------------------------------------------------


def study_text(names: Sequence[str], trials: int, recorded: Path) -> str:
    """Return the study of the participants: beside each kind, with haptic feedback on and off."""
    levels = [f"levels.{name}.other_hand = {to_toml(name)}" for name in names]
    if PLAYBACK in names:
        levels.append(f"levels.{PLAYBACK}.partners.right.file = {to_toml(str(recorded))}")
    return "\n".join(
        (
            'name = "partners"',
            f"block.trials = {trials}",
            f'orders.main = "{2 * len(names)} alone"',
            "[factors.partner]",
            *levels,
            "[factors.haptics]",
            'levels.on.block.force = "full"',
            'levels.off.block.force = "none"',
            "[kinds.alone]",
            'performers = "A"',
        )
    )


def practised() -> Config:
    """Return a rig with practised participants, of whom A is left-handed, and so sits at the left."""
    return parse("", overrides=(*PRACTISED, "session.hand_a=left", "session.hand_b=right"))


def drawn(config: Config, number: int) -> Config:
    """Return a rig whose usual participant is a draw of the posterior."""
    return replace(config, participant=read_posterior().participant(config.participant, SEED + number))


def jobs_beside(study: Study, number: int) -> list[RehearsalJob]:
    """Return the blocks of a participant beside each kind of partner."""
    return jobs_of(blocks_of(drawn(practised(), number), study, SEED, number), SEED, number, None)


def recorded_hand(folder: Path) -> Path:
    """Record a block of two participants, of whom nobody else performs."""
    config = drawn(parse("", overrides=(*PRACTISED, f"block.trials={RECORDED_TRIALS}")), 0)
    return Path(record(jobs_of([config], SEED, 1000, folder)[0]).recording)


@dataclass(frozen=True)
class Blocks:
    """The tables of all blocks, and the dyads of those that were stopped because they took too long."""

    study: StudyData
    given_up: frozenset[str]
    kinds_given_up: tuple[str, ...]  # the right hand of each of these blocks


def performed(jobs: Sequence[RehearsalJob], tell: Tell, what: str) -> Blocks:
    """Perform and measure blocks."""
    tables, given_up = [], []
    for place, job in enumerate(jobs, start=1):
        block = job.config.block
        tell(f"{what}: {block.left} beside {block.right}", place / len(jobs))
        found = rehearse(job, forces=True)
        tables.append(measured(job, place, found, GROUPS))
        if found.given_up:
            given_up.append((job.config.session.dyad, block.right))
    dyads = frozenset(dyad for dyad, _ in given_up)
    return Blocks(study_of(tables, READINGS, {}), dyads, tuple(right for _, right in given_up))


# --- tables ------------------------------------------------------------------------------------------------------


def partner_of(condition: Condition) -> str:
    """Return the kind of partner in a condition of a participant."""
    return condition.partner.removesuffix(" partner") or PERSON


Found = Mapping[tuple[str, str, str], Levels]
"""Levels by measure, kind of partner and force."""


def found_beside(study: StudyData) -> Found:
    """Return the levels of all measures beside each kind of partner."""
    every = levels_of(study, chosen())
    return {(one.measure.name, partner_of(one.condition), one.condition.force): one for one in every}


def text_of(one: Levels | None) -> str:
    """Return a mean with its 95 % confidence interval; shares in %."""
    return "-" if one is None else interval(one.mean, 100.0 if one.measure.within == "share" else 1.0)


def interval(one: Estimate, scale: float = 1.0) -> str:
    """Return an estimate with its confidence interval."""
    if not isfinite(one.value):
        return "-"
    return f"{scale * one.value:.3g} ({scale * one.low:.3g} to {scale * one.high:.3g})"


def beside_part(name: str, title: str, measures: Sequence[str], found: Found, names: Sequence[str]) -> ResultPart:
    """Tabulate measures beside each kind of partner, with haptic feedback on and off."""
    by_name = {one.name: one for one in chosen()}
    units = [f"{one} [{'%' if by_name[one].within == 'share' else by_name[one].unit}]" for one in measures]
    part = ResultPart(name, title, ("partner", "haptics", *units))
    for kind in names:
        for force, haptics in FORCES.items():
            part.add(shown(kind), haptics, *(text_of(found.get((one, kind, force))) for one in measures))
    return part


def paired(found: Found, measure: str, kind: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the levels with haptic feedback on and off, of the participants who have both."""
    on, off = (found.get((measure, kind, force)) for force in ("full", "none"))
    if on is None or off is None:
        return np.empty(0), np.empty(0)
    both = [name for name in on.dyads if name in off.dyads]
    first, second = (np.array([one.values[one.dyads.index(name)] for name in both]) for one in (on, off))
    return first, second


def haptics_part(found: Found, names: Sequence[str]) -> ResultPart:
    """Tabulate what haptic feedback changes beside each kind of partner."""
    compared = ("velocity peaks", "|delay at 20 %|", "cooperative share", "idle time of the participant")
    part = ResultPart(
        "haptics",
        "Effect of haptic feedback: ratios of completion times and efforts, and differences, on against off",
        (
            "partner",
            "completion time [1]",
            "effort of the participant [1]",
            *(f"{one} [{'1' if one == 'velocity peaks' else 's' if 'delay' in one else '%'}]" for one in compared),
        ),
    )
    for kind in names:
        ratios = [ratio(*paired(found, one, kind)) for one in ("completion time", "effort of the participant")]
        gaps = []
        for one in compared:
            on, off = paired(found, one, kind)
            gaps.append(interval(t_interval(on - off), 100.0 if "share" in one or "idle" in one else 1.0))
        part.add(shown(kind), *map(interval, ratios), *gaps)
    return part


def ratio(on: NDArray[np.float64], off: NDArray[np.float64]) -> Estimate:
    """Return the geometric mean of the ratio of paired values, with the interval of a paired t test."""
    return exponential(t_interval(np.log(on / off)))


# --- the study ---------------------------------------------------------------------------------------------------


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run participants beside every kind of partner."""
    names = QUICK_KINDS if quick else kinds()
    size, trials = (QUICK_PARTICIPANTS, QUICK_TRIALS) if quick else (PARTICIPANTS, TRIALS)
    with TemporaryDirectory() as recordings:
        recorded = recorded_hand(Path(recordings)) if PLAYBACK in names else Path()
        plan = parse_study(study_text(names, trials, recorded))
        jobs = [job for number in range(1, size + 1) for job in jobs_beside(plan, number)]
        people = performed(jobs, tell, "participants")
        found = found_beside(people.study)
        yield from _beside(found, people, names, size, trials)
        folder.save("partners", lambda: draw_beside(found, names))


def _beside(found: Found, people: Blocks, names: Sequence[str], size: int, trials: int) -> Iterator[ResultPart]:
    """Yield the tables of the participants."""
    who = f"{size} participants, {trials} trials in each block, mean (95 % CI)"
    own = ("effort of the participant", "share of the work that is the participant's", "idle time of the participant")
    part = beside_part("performance", f"Performance: {who}", (*PERFORMANCE, *own), found, names)
    steering = [one for one in names if one not in (PERSON, STILL, PLAYBACK)]
    lost = [kind for kind in people.kinds_given_up if kind in steering]
    blocks = 2 * size * len(steering)
    part.claim(
        "beside each robot that steers, every participant completes every block",
        not lost,
        f"{blocks - len(lost)} of {blocks} blocks",
    )
    yield part
    limited = OWN[-1].name
    yield beside_part("coordination", f"Coordination: {who}", (*COORDINATION, limited), found, names)
    yield haptics_part(found, names)
