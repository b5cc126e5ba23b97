"""``make evidence ARGS=participants``: which of the paper's results the simulated participants reproduce.

Agreement is no prediction: an earlier search for parameters used all of the paper's figures. Rows that a later
adjustment used again are marked. The results do not depend on the machine.

A pool of dyads performs the paper's plan at full length. A virtual study draws four of them as the paper
counterbalanced its own: one dyad of each starting state. The 95 % predictive interval lies between the 2.5th and
97.5th percentile over many virtual studies. Dyads of the pool appear in several studies, so a small pool makes the
intervals uncertain, and too narrow by a factor of about ``sqrt(1 - 1/n)`` for n dyads of each state.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from evidence.participants.paper import CONFIGURATIONS, EXTRA, STATEMENTS, Sample, Statement
from evidence.participants.trials import PAPER_TRIALS, SEED, Performance, Population, perform_all
from netboard.analysis.cohort.posterior import read_posterior
from netboard.base.config import Config
from netboard.base.looks import PRINT_BODY
from netboard.base.process.workers import cores
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.nodes.rehearsal.jobs import RehearsalJob
from netboard.participants.body.device_models import resolved
from netboard.participants.people.dyad_model import felt_noise
from netboard.participants.people.partner_models import PARTNER_MODELS

STATES = 4
"""Starting states of the paper's plan, one for each of its dyads [1]."""

LIKELY = 0.8
"""Share of studies with the paper's direction from which a direction counts as reproduced [1]."""

DEFAULT = Participant()

ABLATIONS: dict[str, Participant] = {
    "full model": DEFAULT,
    "friction at rest": replace(DEFAULT, rest_skill=0.0),
    "no load skill": replace(DEFAULT, load_skill=0.0),
    "fixed partner": replace(DEFAULT, mirror_rate=0.0),
    "no learning": replace(DEFAULT, novice=1.0),
    "known partner": replace(DEFAULT, stranger=1.0),
    "understood force": replace(DEFAULT, reading=1.0),
    **{name: replace(DEFAULT, partner_model=name) for name in PARTNER_MODELS if name != DEFAULT.partner_model},
}
"""Variants of the model: each is without one part, or has another model of the partner."""


def studies(dyads: Sequence[NDArray[Any]], count: int) -> list[Sample]:
    """Draw virtual studies from the attempts of dyads 1, 2, ...; dyads four apart share a starting state."""
    if len(dyads) % STATES:
        raise ValueError(f"found {len(dyads)} dyads, expected a multiple of {STATES}, as many of each starting state")
    rng = np.random.default_rng((SEED, count))
    chosen = rng.integers(0, len(dyads) // STATES, (count, STATES)) * STATES + np.arange(STATES)
    return [Sample(np.concatenate([dyads[k] for k in row])) for row in chosen]


@dataclass(frozen=True)
class Prediction:
    """Prediction of the model for a statement of the paper.

    - `values`: the quantity in each virtual study.
    """

    statement: Statement
    values: NDArray[np.float64]

    @property
    def interval(self) -> tuple[float, float, float]:
        """Median and limits of the 95 % predictive interval."""
        low, middle, high = np.percentile(self.values, (2.5, 50, 97.5))
        return float(middle), float(low), float(high)

    @property
    def inside(self) -> bool | None:
        """Whether the paper's value lies in the interval; None without a value."""
        _, low, high = self.interval
        value = self.statement.value
        return None if value is None else low <= value <= high

    @property
    def probability(self) -> float | None:
        """Share of studies with the paper's direction; None without one [1]."""
        sense = self.statement.sense
        return float(np.mean(sense * self.values > 0)) if sense else None

    @property
    def reproduced(self) -> str:
        """Whether the model reproduces the result: "yes", "NO", "unclear" or "not reported"."""
        if self.inside is not None:
            return "yes" if self.inside else "NO"
        if self.probability is None:
            return "not reported"
        return "yes" if self.probability >= LIKELY else "unclear" if self.probability >= 0.5 else "NO"


def predictions(samples: Sequence[Sample]) -> list[Prediction]:
    """Evaluate all statements in virtual studies."""
    return [Prediction(one, np.array([one.of(sample) for sample in samples], float)) for one in (*STATEMENTS, *EXTRA)]


QUICK_TRIALS = 6
"""Number of trials in a block of a quick run; otherwise it is the paper's [1]."""

DYADS, QUICK_DYADS = 32, 8
"""Number of dyads of the full model [1]."""

ABLATED_DYADS, QUICK_ABLATED_DYADS = 16, 4
"""Largest number of dyads of the other variants [1]."""

DRAWS, QUICK_DRAWS = 40, 2
"""Number of draws of the posterior, each with a virtual study of its own [1]."""

SLOWING_DYADS, SLOWING_TRIALS = 8, 8
"""Number of dyads, and of trials in a block, for the effect of parts of the force [1]."""

QUICK_VARIANTS = ("full model", "mechanics")


def study(
    count: int, dyads: int | None, workers: int | None, folder: Folder, tell: Tell, *, quick: bool
) -> Iterator[ResultPart]:
    """Draw `count` virtual studies from a pool of dyads, and compare them with the paper's results."""
    # A multiple of STATES, so that each starting state has as many dyads.
    pool = STATES * ceil((dyads or (QUICK_DYADS if quick else DYADS)) / STATES)
    workers = workers or cores()
    variants = QUICK_VARIANTS if quick else tuple(ABLATIONS)
    found: dict[str, list[Prediction]] = {}
    for number, name in enumerate(variants):
        size, trials = pool, QUICK_TRIALS if quick else PAPER_TRIALS
        if name != variants[0]:
            size = min(size, QUICK_ABLATED_DYADS if quick else ABLATED_DYADS)
        performances = list(_performances(name, size, trials, workers, number, len(variants), tell))
        found[name] = predictions(studies([one.attempts for one in performances], count))
        if name == variants[0]:
            title = f"{count} virtual studies of {STATES} dyads, drawn from {len(performances)} dyads"
            yield predictions_part("predictions", f"{title}, {trials} trials a block", found[name], performances)
            folder.save("participants", lambda: draw(found[variants[0]]))
            attempts = np.concatenate([one.attempts for one in performances])
            sample = Sample(attempts)
            yield order_part(sample)
            yield others_part(sample, Participant(), Config())
            yield rest_part(attempts)
    yield ablations_part(found)
    yield posterior_part(QUICK_DRAWS if quick else DRAWS, QUICK_TRIALS if quick else PAPER_TRIALS, workers, tell)
    if not quick:
        tell("bimanual blocks with parts of the force", 1.0)
        yield slowing_part(SLOWING_DYADS, SLOWING_TRIALS, workers)


def _performances(
    name: str, dyads: int, trials: int, workers: int, number: int, variants: int, tell: Tell
) -> Iterator[Performance]:
    population = Population(ABLATIONS[name], trials)
    tasks = [(population.jobs(dyad), dyad) for dyad in range(1, dyads + 1)]
    for done, performance in enumerate(perform_all(tasks, workers)):
        tell(f"{name}: dyad {done + 1} of {dyads}", (number + (done + 1) / dyads) / variants)
        yield performance


def posterior_part(draws: int, trials: int, workers: int, tell: Tell) -> ResultPart:
    """Tabulate the predictions with participants of the posterior: one draw, and dyads of its own, in each study."""
    posterior, tasks = read_posterior(), []
    for number in range(draws):
        population = Population(posterior.participant(DEFAULT, SEED + number), trials)
        tasks += [(population.jobs(dyad), dyad) for dyad in range(STATES * number + 1, STATES * (number + 1) + 1)]
    performances = []
    for done, performance in enumerate(perform_all(tasks, workers)):
        tell(f"posterior: dyad {done + 1} of {len(tasks)}", done / len(tasks))
        performances.append(performance)
    each = [performances[first : first + STATES] for first in range(0, len(performances), STATES)]
    found = predictions([Sample(np.concatenate([one.attempts for one in study])) for study in each])
    title = f"{draws} virtual studies of {STATES} dyads, each of another draw of the posterior, {trials} trials a block"
    return predictions_part("posterior", title, found, performances)


def predictions_part(
    name: str, title: str, found: Sequence[Prediction], performances: Sequence[Performance]
) -> ResultPart:
    """Tabulate predictions of the model, and whether it reproduces each result."""
    part = ResultPart(
        name,
        f"Results of the paper: {title}",
        "result | use | paper | direction | median | 2.5 % | 97.5 % | P(direction) | reproduced",
    )
    for one in found:
        statement = one.statement
        value = "-" if statement.value is None else statement.value
        probability = "-" if one.probability is None else f"{one.probability:.2f}"
        use = "adjusted to" if statement.adjusted else "compared"
        part.add(statement.name, use, value, _direction(statement), *one.interval, probability, one.reproduced)
    others = [one for one in found if not one.statement.adjusted]
    inside = [bool(one.inside) for one in others if one.inside is not None]
    likely = [one.reproduced == "yes" for one in others if one.probability is not None]
    for claim, reproduced in (
        ("compared value of the paper lies in its 95 % predictive interval", inside),
        (f"compared direction of the paper appears in at least {LIKELY:.0%} of the virtual studies", likely),
    ):
        part.claim(f"every {claim}", all(reproduced), f"{sum(reproduced)} of {len(reproduced)}")
    success = np.concatenate([one.attempts["success"] for one in performances])
    given_up = sum(one.given_up for one in performances)
    part.claim(
        "no simulated participant is excluded, and all blocks are completed",
        given_up == 0,
        f"{len(performances)} dyads: {given_up} blocks given up; "
        f"{np.sum(~success)} falls of the ball in {np.sum(success)} trials",
    )
    return part


def _direction(statement: Statement) -> str:
    """Format the direction that the paper reports."""
    return {1: "above 0", -1: "below 0", 0: "-"}[statement.sense]


def ablations_part(found: dict[str, list[Prediction]]) -> ResultPart:
    """Tabulate each result without one part of the model: the median, and the probability of the direction."""
    part = ResultPart("ablations", "Median and, in brackets, probability of the direction", ("result", "paper", *found))
    for k, one in enumerate(found[next(iter(found))]):
        statement = one.statement
        paper = _direction(statement) if statement.value is None else statement.value
        part.add(statement.name, paper, *(_cell(variant[k]) for variant in found.values()))
    return part


def _cell(one: Prediction) -> str:
    """Format a prediction; an exclamation mark means that it is not reproduced."""
    mark = " !" if one.reproduced == "NO" else ""
    chance = "" if one.probability is None else f" ({one.probability:.2f})"
    return f"{one.interval[0]:.3g}{chance}{mark}"


def draw(found: Sequence[Prediction]) -> Any:
    """Draw the predictive intervals of all printed values, relative to the paper's, and all directions."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7), layout="constrained")
    left, right = figure.subplots(1, 2)
    values = [one for one in found if one.statement.value is not None]
    for place, one in enumerate(reversed(values)):
        middle, low, high = (number / one.statement.value for number in one.interval)  # type: ignore[operator]
        colour = "C1" if one.statement.adjusted else "C0"
        left.plot([low, high], [place, place], color=colour)
        left.plot(middle, place, "o", color=colour, markersize=4)
    left.axvline(1.0, color="grey", linewidth=0.8)
    left.set_yticks(range(len(values)), [one.statement.name for one in reversed(values)], fontsize=PRINT_BODY)
    left.set(xlabel="model / paper: median and 95 % predictive interval", title="values (orange: adjusted to)")
    directions = [one for one in found if one.probability is not None]
    for place, one in enumerate(reversed(directions)):
        right.barh(place, one.probability, color="C1" if one.statement.adjusted else "C0")
    right.axvline(0.5, color="grey", linewidth=0.8)
    right.set_yticks(range(len(directions)), [one.statement.name for one in reversed(directions)], fontsize=PRINT_BODY)
    right.set(xlim=(0, 1), xlabel="probability of the paper's direction", title="directions")
    return figure


# --- the order of the haptic conditions ------------------------------------------------------------------------------


def order_part(sample: Sample) -> ResultPart:
    """Tabulate how the haptic effect on the completion time depends on the condition that performers begin with."""
    part = ResultPart(
        "order",
        "Haptic effect on the completion time by the condition that a performer begins with",
        "configuration | performers | begins on: effect [%] | begins off: effect [%] "
        "| difference [%] | 95 % CI low | 95 % CI high",
    )
    for configuration in CONFIGURATIONS:
        began_on, effects = sample.haptic_effects(configuration)
        on, off = effects[began_on], effects[~began_on]
        gap = stats.ttest_ind(on, off, equal_var=False)
        limits = gap.confidence_interval(0.95)
        numbers = (on.mean(), off.mean(), on.mean() - off.mean(), limits.low, limits.high)
        part.add(configuration, len(effects), *(100.0 * float(np.expm1(number)) for number in numbers))
    return part


# --- hands at rest ---------------------------------------------------------------------------------------------------

LONG_REST = 2.0
"""Time for which people do not hold a hand still in a trial [s]."""


def rest_part(rows: NDArray[Any]) -> ResultPart:
    """Tabulate how often the reading of a hand does not change for long."""
    part = ResultPart(
        "rest",
        f"Attempts in which the reading of a hand does not change for {LONG_REST:g} s or more",
        "configuration | haptics | attempts | share of them [%] | longest such time [s]",
    )
    for configuration in CONFIGURATIONS:
        for haptics in (False, True):
            chosen = ((rows["performer"] == "dyad") == (configuration == "dyadic")) & (rows["haptics"] == haptics)
            rest = rows["rest"][chosen]
            share = 100.0 * float(np.mean(rest >= LONG_REST))
            part.add(configuration, "on" if haptics else "off", len(rest), share, float(rest.max()))
    return part


# --- comparison with measurements and models of others ---------------------------------------------------------------


def others_part(sample: Sample, person: Participant, config: Config) -> ResultPart:
    """Compare parameters and behaviour with measurements and models of others."""
    return ResultPart(
        "others",
        "Comparison with measurements and models of others",
        "quantity | model | others, low | others, high | agrees | source",
        [*_compare_parameters(person, config), *_compare_behaviour(sample)],
    )


def _row(name: str, value: float, low: float, high: float, source: str) -> tuple[Any, ...]:
    """Return a row that says whether the value lies in the range."""
    return name, float(value), low, high, "yes" if low <= value <= high else "NO", source


def _compare_parameters(person: Participant, config: Config) -> Iterator[tuple[Any, ...]]:
    yield _row("visual delay [s]", person.visual_delay, 0.08, 0.23, "models: Takagi 2017, Lokesh 2023, Insperger")
    yield _row("haptic delay [s]", person.haptic_delay, 0.05, 0.1, "Cluff, Crevecoeur and Scott 2015; Lokesh 2023")
    yield _row("delay of the reflexes [s]", person.reflex_delay, 0.025, 0.1, "Cluff, Crevecoeur and Scott 2015")
    yield _row("refractory time [s]", person.refractory, 0.25, 0.55, "van de Kamp et al. 2013, plants of order 0 to 2")
    yield _row("muscle lag [s]", person.muscle_lag, 0.04, 0.04, "Lokesh 2023, model")
    felt = felt_noise(person, config.physics, resolved(config.virtual))
    yield _row("noise of a felt force [N]", felt, 0.02, 0.05, "7 to 10 % (Pang, Tan and Durlach 1991) of 0.3 to 0.5 N")


def _compare_behaviour(sample: Sample) -> Iterator[tuple[Any, ...]]:
    alone = float(sample.of("peaks", "bimanual").sum() / sample.of("completion", "bimanual").sum())
    first, sparc = (float(np.nanmedian(sample.of(name, "bimanual"))) for name in ("first_move", "sparc"))
    yield _row("first movement of the board after the release, median [s]", first, 0.2, 0.6, "reaction and muscle lags")
    yield _row("SPARC of the ball's speed, bimanual, median", sparc, -2.5, -1.41, "one smooth movement: -1.41 at most")
    yield _row("velocity peaks per second, bimanual", alone, 0.69, 0.88, "this paper: 3.92/5.71 to 3.17/3.61")
    levels = [sample.levels("completion", dyad, True) for dyad in sample.dyads]
    share = float(np.mean([both < min(a, b) for a, b, both in levels]))
    source = "Ganesh et al. 2014: better with a worse partner, too"
    yield _row("share of dyads faster than their better participant, haptics on", share, 0.5, 1.0, source)


# --- parts of the force ----------------------------------------------------------------------------------------------

CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "haptics off": ("none", {}),
    "full force": ("full", {}),
    "force of the other hand only": ("partner_only", {}),
    "force of ball and board only": ("environment_only", {}),
    "full force, no load compensation": ("full", {"load_skill": 0.0}),
    "full force, friction not compensated at rest": ("full", {"rest_skill": 0.0}),
    "full force, with reflex yielding": ("full", {"partner_model": "follower"}),
    "full force, with impedance adaptation": ("full", {"partner_model": "impedance"}),
}
"""Force condition and changed parameters of each case."""


def slowing_part(dyads: int, trials: int, workers: int) -> ResultPart:
    """Tabulate why haptic feedback changes the completion time of one person: mean, and ratio to that without it.

    Blocks, participants and random numbers are those of the blocks without haptic feedback; only the force differs. So
    each participant is compared with themselves, with the same practice and skill.
    """
    means = {name: _means(list(perform_all(_tasks(name, dyads, trials), workers))) for name in CASES}
    base = means[next(iter(CASES))]
    part = ResultPart(
        "slowing",
        f"Effect of parts of the force on one person with both hands: {2 * dyads} participants, blocks of {trials}",
        "bimanual blocks | completion time [s] | change [%] | 95 % CI low | 95 % CI high",
    )
    for name, times in means.items():
        ratios = np.log(times / base)
        mean, error = float(ratios.mean()), float(ratios.std(ddof=1) / np.sqrt(len(ratios)))
        low, high = (100.0 * np.expm1(mean + way * 1.96 * error) for way in (-1, 1))
        part.add(name, float(times.mean()), 100.0 * float(np.expm1(mean)), float(low), float(high))
    return part


def _tasks(name: str, dyads: int, trials: int) -> list[tuple[Sequence[RehearsalJob], int]]:
    """Return the blocks of a case: the bimanual blocks without haptic feedback, with the force of the case."""
    force, keys = CASES[name]
    population = Population(replace(Participant(), **keys), trials=trials)
    return [([_with_force(job, force) for job in population.bimanual_jobs(dyad)], dyad) for dyad in range(1, dyads + 1)]


def _with_force(job: RehearsalJob, force: str) -> RehearsalJob:
    return replace(job, config=replace(job.config, block=replace(job.config.block, force=force)))


def _means(performances: Sequence[Performance]) -> NDArray[np.float64]:
    """Return the mean completion time of each participant [s]."""
    rows = np.concatenate([one.attempts for one in performances])
    rows = rows[rows["success"]]
    return np.array(
        [
            rows["completion"][(rows["dyad"] == dyad) & (rows["performer"] == who)].mean()
            for dyad in np.unique(rows["dyad"])
            for who in ("A", "B")
        ]
    )
