"""``make evidence ARGS=information``: what the force tells simulated partners, and what it is worth, in many scenes.

Dyads perform a block with haptic feedback on and off. The same dyads, with the same random numbers, perform it with
each model of the partner. So a ratio of completion times is the effect of haptic feedback, or of what one model does
more than another; its confidence interval is that of a paired t test over dyads, of the logarithms.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from math import sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from netboard.base.config import Config
from netboard.base.process.workers import cores
from netboard.base.tables.simulated import Participant, PartnerModel
from netboard.benchmarks.harness.processes import fresh_processes
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.participants.people.observer import uncertainty
from netboard.participants.people.partner_models import INFORMED, PARTNER_MODELS
from netboard.participants.people.population import LETTERS, person_of
from netboard.participants.seat.block import Rehearsal

SEED = 44
"""Seed of the participants and of their blocks [1]."""

DYADS, QUICK_DYADS = 16, 4
"""Number of dyads in each scene [1]."""

TRIALS, QUICK_TRIALS = 40, 6
"""Successful trials in a block [1]."""

PRACTICE = 300.0
"""Trials that each participant has practised [1]."""

MODELS: tuple[PartnerModel, ...] = tuple(PARTNER_MODELS)

SCENES: dict[str, tuple[str, str, tuple[float, ...]]] = {
    "k_s": ("physics", "N/m", (1.4, 14.0, 35.0, 140.0, 560.0)),
    "k_h": ("physics", "N/m", (50.0, 100.0, 200.0, 800.0)),
    "m": ("physics", "kg", (0.01, 0.05, 0.1)),
    "c_h": ("physics", "N s/m", (0.5, 2.0, 10.0)),
    "friction": ("virtual", "N", (0.13, 0.26, 0.5, 1.0)),
}
"""Key of each factor, its table, unit and levels."""

QUICK_SCENES = {"k_s": (1.4, 140.0), "c_h": (10.0,)}
"""Levels of the quick form."""

SKILLS = (0.5, 1.0, 1.5, 2.0)
"""Factors of the noise of the partner's senses and movements, in the comparison of partners [1]."""

ACQUAINTANCES = (0.0, 60.0, 120.0, 240.0, 480.0)
"""Numbers of dyadic trials that partners have performed before the block [1]."""

SENSES: dict[str, dict[str, float]] = {
    "delays 175 and 70 ms, as by default": {},
    "delays 100 and 50 ms": {"visual_delay": 0.1, "haptic_delay": 0.05, "lookahead": 2.925},
    "delays 80 and 80 ms": {"visual_delay": 0.08, "haptic_delay": 0.08, "lookahead": 3.40625},
    **{f"weber_fraction = {level:g}": {"weber_fraction": level} for level in (0.05, 0.2, 0.4, 0.8)},
    **{f"partner_noise = {level:g}": {"partner_noise": level} for level in (0.1, 0.25, 1.0)},
    **{f"tilt_noise_deg = {level:g}": {"tilt_noise_deg": level} for level in (0.11, 0.44)},
}
"""Changed keys of both participants, for what each of them decides on the worth of a force.

With other visual delays `lookahead` is such that the ball is predicted as far beyond the present.
"""

_NOISY = ("position_noise", "velocity_noise", "tilt_noise_deg", "amplitude_cv", "threshold_cv")


@dataclass(frozen=True)
class Case:
    """A block of a dyad: the model of the partner, changed keys, and the skill of participant B."""

    model: PartnerModel
    dyad: int
    trials: int
    configuration: Literal["dyadic", "bimanual"] = "dyadic"
    force: str = "full"
    keys: dict[str, dict[str, float]] = field(default_factory=dict)
    skill: float = 1.0
    acquaintance: float | Literal["plan"] = "plan"  # a dyad that knows each other
    person: dict[str, Any] = field(default_factory=dict)

    def config(self) -> Config:
        """Return the configuration of the block."""
        base = Config()
        together: dict[str, Any] = {"acquaintance": self.acquaintance, "felt_trials": self.acquaintance}
        person = replace(base.participant, partner_model=self.model, practice=PRACTICE, **together, **self.person)
        changed = {table: replace(getattr(base, table), **values) for table, values in self.keys.items()}
        block = replace(
            base.block, configuration=self.configuration, force=self.force, trials=self.trials, seed=self.dyad
        )
        return replace(base, participant=person, block=block, **changed)


@dataclass(frozen=True)
class Result:
    """Mean completion time of a block, number of falls of the ball, and of successful trials."""

    completion: float
    falls: int
    successes: int


def perform(case: Case) -> Result:
    """Perform a block."""
    config = case.config()
    people = {letter: person_of(config.participant, SEED, case.dyad, letter) for letter in LETTERS}
    people["B"] = with_skill(people["B"], case.skill)
    rehearsal = Rehearsal(config, people)
    for _ in rehearsal.pieces():
        pass
    found = rehearsal.summary()
    return Result(float(np.mean(found.completions)), found.failures, len(found.completions))


def with_skill(person: Participant, factor: float) -> Participant:
    """Return a participant whose senses and movements are noisier by a factor."""
    return replace(person, **{name: factor * getattr(person, name) for name in _NOISY})


def study(dyads: int | None, workers: int | None, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Compare models of the partner in each scene, and with partners of different skill."""
    size, trials = dyads or (QUICK_DYADS if quick else DYADS), QUICK_TRIALS if quick else TRIALS
    levels = QUICK_SCENES if quick else {name: values for name, (_, _, values) in SCENES.items()}
    with fresh_processes(workers or cores()) as pool:
        cells = list(_cells(levels, size, trials, pool, tell))
        yield scenes_part(cells, size, trials)
        yield models_part(cells, size, trials)
        yield filters_part(cells, size, trials)
        yield hands_part(size, trials, pool)
        yield senses_part(list(SENSES)[::6] if quick else list(SENSES), size, trials, pool, tell)
        yield skills_part(SKILLS[::3] if quick else SKILLS, size, trials, pool, tell)
        yield acquaintance_part(ACQUAINTANCES[::4] if quick else ACQUAINTANCES, size, trials, pool, tell)


@dataclass(frozen=True)
class Cell:
    """A scene: the changed keys, and the results of all dyads with haptic feedback off and on, for each model."""

    label: str
    keys: dict[str, dict[str, float]]
    off: dict[PartnerModel, list[Result]]
    on: dict[PartnerModel, list[Result]]


def _cells(
    levels: dict[str, tuple[float, ...]], dyads: int, trials: int, pool: ProcessPoolExecutor, tell: Tell
) -> Iterator[Cell]:
    """Perform the block of every dyad in each scene, with haptic feedback off and on, with each model."""
    scenes = [(name, level) for name, values in levels.items() for level in values]
    for number, (name, level) in enumerate(scenes):
        table, unit, _ = SCENES[name]
        label, keys = f"{name} = {level:g} {unit}", {table: {name: level}}
        tell(label, number / len(scenes))
        off, on = (
            {
                model: performed([Case(model, d, trials, force=f, keys=keys) for d in numbered(dyads)], pool)
                for model in MODELS
            }
            for f in ("none", "full")
        )
        yield Cell(label, keys, off, on)


def scenes_part(cells: Sequence[Cell], dyads: int, trials: int) -> ResultPart:
    """Tabulate what information is worth: completion times, and their ratio to those of the mechanics alone."""
    part = ResultPart(
        "scenes",
        f"Completion time of {dyads} dyads, {trials} trials in a block, by what the force tells of the partner",
        "changed | uncertainty of the partner's aim, seen [mm] | seen and felt [mm] | haptics off [s] | mechanics [s] "
        "| position [s] | goal [s] | position / mechanics | 95 % CI low | 95 % CI high | goal / mechanics "
        "| 95 % CI low | 95 % CI high | falls, mechanics | falls, position | falls, goal",
    )
    harmed: list[str] = []
    for cell in cells:
        config = Case("position", 1, trials, keys=cell.keys).config()
        known = [1e3 * uncertainty(config.participant, config.physics, config.virtual, way) for way in (False, True)]
        alone = cell.on["mechanics"]
        ratios = {model: ratio(cell.on[model], alone) for model in INFORMED}
        falls = {model: sum(one.falls for one in cell.on[model]) for model in ("mechanics", *INFORMED)}
        times = [mean_time(one) for one in (cell.off["mechanics"], *(cell.on[model] for model in falls))]
        part.add(
            cell.label, *known, *times, *(number for three in ratios.values() for number in three), *falls.values()
        )
        if ratios["position"][1] > 1.0 or more_falls(falls["position"], falls["mechanics"]):
            harmed.append(cell.label)
    part.claim(
        "information on the partner's position never makes a dyad slower or less successful, within 95 % confidence",
        not harmed,
        ", ".join(harmed) or f"{len(cells)} scenes",
    )
    return part


def models_part(cells: Sequence[Cell], dyads: int, trials: int) -> ResultPart:
    """Tabulate the effect of haptic feedback with each model of the partner."""
    part = ResultPart(
        "models",
        f"Completion time with haptic feedback over that without it, and its 95 % CI: {dyads} dyads, "
        f"{trials} trials in a block",
        ("changed", *MODELS),
    )
    for cell in cells:
        found = [ratio(cell.on[model], cell.off[model]) for model in MODELS]
        part.add(cell.label, *(f"{middle:.2f} ({low:.2f} to {high:.2f})" for middle, low, high in found))
    return part


def filters_part(cells: Sequence[Cell], dyads: int, trials: int) -> ResultPart:
    """Tabulate what a filter of what is seen is worth, without haptic feedback, and what the force adds to it."""
    part = ResultPart(
        "filters",
        f"Worth of the filter and of the force: completion time of {dyads} dyads, {trials} trials in a block",
        "changed | haptics off: mechanics [s] | sight [s] | sight / mechanics | 95 % CI low | 95 % CI high "
        "| haptics on: sight [s] | position [s] | position / sight | 95 % CI low | 95 % CI high",
    )
    harmed = []
    for cell in cells:
        worths = ((cell.off["mechanics"], cell.off["sight"]), (cell.on["sight"], cell.on["position"]))
        numbers: list[float] = []
        for without, by in worths:
            numbers += [mean_time(without), mean_time(by), *ratio(by, without)]
        part.add(cell.label, *numbers)
        if numbers[-2] > 1.0:
            harmed.append(cell.label)
    part.claim(
        "the force never makes a dyad slower that filters what it sees, within 95 % confidence",
        not harmed,
        ", ".join(harmed) or f"{len(cells)} scenes",
    )
    return part


def numbered(dyads: int) -> range:
    """Return the numbers of the dyads."""
    return range(1, dyads + 1)


def performed(cases: Sequence[Case], pool: ProcessPoolExecutor) -> list[Result]:
    """Perform blocks in parallel."""
    return list(pool.map(perform, cases))


def mean_time(results: Sequence[Result]) -> float:
    """Return the mean over dyads of the completion time [s]."""
    return float(np.mean([one.completion for one in results]))


def ratio(one: Sequence[Result], other: Sequence[Result]) -> tuple[float, float, float]:
    """Return the geometric mean of the ratio of completion times, with the limits of its 95 % confidence interval."""
    logs: NDArray[np.float64] = np.log([a.completion / b.completion for a, b in zip(one, other, strict=True)])
    error = float(student.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs)))
    low, middle, high = (float(np.exp(logs.mean() + way * error)) for way in (-1, 0, 1))
    return middle, low, high


def more_falls(found: int, expected: int) -> bool:
    """Return whether the ball falls more often, beyond two standard deviations of the difference of two counts."""
    return found - expected > 2.0 * sqrt(found + expected)


def hands_part(dyads: int, trials: int, pool: ProcessPoolExecutor) -> ResultPart:
    """Show that one person with both hands, who has no partner, does the same whatever a force would tell."""
    part = ResultPart(
        "hands",
        "One person with both hands, haptic feedback on",
        ("model of the partner", "completion time [s]", "falls"),
    )
    found: dict[PartnerModel, list[Result]] = {}
    for model in MODELS:
        cases = [Case(model, dyad, trials, configuration="bimanual") for dyad in numbered(dyads)]
        found[model] = performed(cases, pool)
        part.add(model, mean_time(found[model]), sum(one.falls for one in found[model]))
    alike = [name for name, parts in PARTNER_MODELS.items() if parts.reflex_gain == parts.impedance_gain == 0.0]
    same = all(found[model] == found["mechanics"] for model in alike)
    claim = f"one person with both hands performs the same trials with {', '.join(alike[:-1])} and {alike[-1]}"
    part.claim(claim, same, f"{dyads} participants")
    return part


def senses_part(names: Sequence[str], dyads: int, trials: int, pool: ProcessPoolExecutor, tell: Tell) -> ResultPart:
    """Tabulate how the worth of information depends on what is assumed of senses and partner."""
    part = ResultPart(
        "senses",
        f"Worth of information by what is assumed of senses and partner: {dyads} dyads, {trials} trials in a block",
        ("changed", "uncertainty of the partner's aim, seen [mm]", "seen and felt [mm]", *_WORTH),
    )
    harmed = []
    for number, name in enumerate(names):
        tell(name, number / len(names))
        config = Case("position", 1, trials, person=SENSES[name]).config()
        known = [1e3 * uncertainty(config.participant, config.physics, config.virtual, way) for way in (False, True)]
        worth = _worth({"person": SENSES[name]}, dyads, trials, pool)
        part.add(name, *known, *worth)
        if worth[3] > 1.0:
            harmed.append(name)
    part.claim(
        "information never makes a dyad slower, whatever the senses, within 95 % confidence",
        not harmed,
        ", ".join(harmed) or f"{len(names)} variants",
    )
    return part


def skills_part(skills: Sequence[float], dyads: int, trials: int, pool: ProcessPoolExecutor, tell: Tell) -> ResultPart:
    """Tabulate the benefit of information by the partner's skill, as Ganesh et al. (2014) did for human pairs."""
    part = ResultPart(
        "skills",
        f"Benefit of information by the partner's skill: {dyads} dyads, {trials} trials in a block",
        ("noise of partner B, over that of A", *_WORTH),
    )
    worths = {}
    for number, skill in enumerate(skills):
        tell(f"noise of partner B x {skill:g}", number / len(skills))
        worths[skill] = _worth({"skill": skill}, dyads, trials, pool)
        part.add(skill, *worths[skill])
    worse = [f"{skill:g}" for skill, worth in worths.items() if worth[2] >= 1.0]
    part.claim(
        "information makes dyads faster on average, with a better and with a worse partner",
        not worse,
        ", ".join(worse) or f"{len(skills)} skills",
    )
    return part


def acquaintance_part(
    counts: Sequence[float], dyads: int, trials: int, pool: ProcessPoolExecutor, tell: Tell
) -> ResultPart:
    """Tabulate the benefit of information by the dyadic trials that the partners have performed."""
    part = ResultPart(
        "acquaintance",
        "Benefit of information by the dyadic trials before the block, all with haptic feedback: "
        f"{dyads} dyads, {trials} trials in the block",
        ("dyadic trials before", "haptics off [s]", *_WORTH),
    )
    harmed = []
    for number, count in enumerate(counts):
        tell(f"{count:g} dyadic trials before", number / len(counts))
        off = [Case("mechanics", dyad, trials, force="none", acquaintance=count) for dyad in numbered(dyads)]
        worth = _worth({"acquaintance": count}, dyads, trials, pool)
        part.add(count, mean_time(performed(off, pool)), *worth)
        if worth[3] > 1.0:
            harmed.append(f"{count:g}")
    part.claim(
        "information never makes a dyad slower, however little it knows each other, within 95 % confidence",
        not harmed,
        ", ".join(harmed) or f"{len(counts)} levels",
    )
    return part


_WORTH = ("mechanics [s]", "position [s]", "position / mechanics", "95 % CI low", "95 % CI high")


def _worth(
    keys: dict[str, Any], dyads: int, trials: int, pool: ProcessPoolExecutor
) -> tuple[float, float, float, float, float]:
    """Return completion times with the mechanics alone and with position exchange, and their ratio with its limits."""
    alone, informed = (
        performed([Case(model, dyad, trials, **keys) for dyad in numbered(dyads)], pool)
        for model in ("mechanics", "position")
    )
    return mean_time(alone), mean_time(informed), *ratio(informed, alone)
