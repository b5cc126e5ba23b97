"""``make evidence ARGS=participants``: which of the paper's results the simulated participants reproduce.

Agreement is no prediction: an earlier search for parameters used all of the paper's figures, and the model was built by
people who had seen them. Rows that a later adjustment or the fit used again are marked.

The library for linear algebra rounds differently on another kind of processor. Dyads with haptic feedback then perform
other trials of the same distribution.

Dyads perform the paper's plan at full length. Each four of them are a virtual study like the paper's. The first ones
also perform it with variants of the model: with the same seeds, so that differences are paired.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from evidence.participants.behaviour import order_part, others_part, rest_part
from evidence.participants.paper import DYADS, Sample
from evidence.participants.predictions import (
    Prediction,
    ablations_part,
    differences_part,
    draw,
    models_part,
    predictions,
    predictions_part,
    studies,
)
from evidence.participants.slowing import slowing_part
from evidence.participants.trials import PAPER_TRIALS, SEED, Performance, Population, perform_all
from netboard.analysis.cohort.posterior import read_posterior
from netboard.base.process.workers import cores
from netboard.base.tables.simulated import Participant, PartnerModel
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.participants.people.partner_models import PARTNER_MODELS

DEFAULT = Participant()

VARIANTS: dict[str, Participant] = {
    "full model": DEFAULT,
    **{name: replace(DEFAULT, partner_model=name) for name in PARTNER_MODELS if name != DEFAULT.partner_model},
    "no acquaintance": replace(DEFAULT, stranger=1.0, reading=1.0),
    "understood force": replace(DEFAULT, reading=1.0),
    "no learning": replace(DEFAULT, novice=1.0),
    "friction at rest": replace(DEFAULT, rest_skill=0.0),
    "no load skill": replace(DEFAULT, load_skill=0.0),
}
"""Variants of the model: each has another model of the partner, or is without one part."""

QUICK_VARIANTS = ("full model", "mechanics")

STUDIES, QUICK_STUDIES = 48, 2
"""Virtual studies of the full model [1]."""

VARIED_STUDIES, QUICK_VARIED_STUDIES = 12, 1
"""Largest number of virtual studies of the other variants [1]."""

DRAWS, QUICK_DRAWS = 40, 2
"""Number of draws of the posterior, each with a virtual study of its own [1]."""

COMPARED: tuple[PartnerModel, ...] = ("position", "mechanics")
"""Models of the partner with which the draws of the posterior perform."""

QUICK_TRIALS = 6
"""Number of trials in a block of a quick run; otherwise it is the paper's [1]."""

SLOWING_DYADS = 16
"""Number of dyads for the effect of parts of the force [1]."""


def study(count: int | None, workers: int | None, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Let `count` virtual studies perform, and compare them with the paper's results."""
    count, trials = count or (QUICK_STUDIES if quick else STUDIES), QUICK_TRIALS if quick else PAPER_TRIALS
    workers = workers or cores()
    full = _performed("full model", VARIANTS["full model"], DYADS * count, trials, workers, tell)
    whole = predictions(studies(full))
    title = f"{count} virtual studies of {DYADS} dyads, {trials} trials a block"
    yield predictions_part("predictions", title, whole, full, "adjusted")
    folder.save("participants", lambda: draw(whole))
    attempts = np.concatenate([one.attempts for one in full])
    yield order_part(Sample(attempts))
    yield others_part(DEFAULT)
    yield rest_part(attempts)
    size = DYADS * min(count, QUICK_VARIED_STUDIES if quick else VARIED_STUDIES)
    found = {"full model": predictions(studies(full[:size]))}
    for name in QUICK_VARIANTS[1:] if quick else list(VARIANTS)[1:]:
        found[name] = predictions(studies(_performed(name, VARIANTS[name], size, trials, workers, tell)))
    yield models_part(found, "adjusted")
    yield ablations_part(found)
    yield differences_part(found)
    yield from posterior_parts(QUICK_DRAWS if quick else DRAWS, trials, workers, tell)
    tell("bimanual blocks with parts of the force", 1.0)
    yield slowing_part(1 if quick else SLOWING_DYADS, trials, workers)


def _performed(
    name: str, people: Participant | Sequence[Participant], dyads: int, trials: int, workers: int, tell: Tell
) -> list[Performance]:
    """Let dyads perform the paper's plan; ``people``: the parameters of all, or of the dyads of each virtual study."""
    usual = [people] * dyads if isinstance(people, Participant) else np.repeat(np.array(people, object), DYADS).tolist()
    tasks = [(Population(one, trials).jobs(dyad), dyad) for dyad, one in enumerate(usual, 1)]
    performances = []
    for performance in perform_all(tasks, workers):
        performances.append(performance)
        tell(f"{name}: dyad {len(performances)} of {dyads}", len(performances) / dyads)
    return performances


def posterior_parts(draws: int, trials: int, workers: int, tell: Tell) -> Iterator[ResultPart]:
    """Tabulate the predictions with participants of the posterior: one draw, and dyads of its own, in each study."""
    posterior, blocks = read_posterior(), f"{trials} trials a block"
    places = np.random.default_rng(SEED).permutation(len(posterior.draws))[:draws]
    found: dict[str, list[Prediction]] = {}
    for name in COMPARED:
        usual = replace(DEFAULT, partner_model=name)
        people = [posterior.at(usual, int(place)) for place in places]
        performances = _performed(f"posterior, {name}", people, DYADS * draws, trials, workers, tell)
        found[name] = predictions(studies(performances))
        if name == DEFAULT.partner_model:
            title = f"{draws} virtual studies of {DYADS} dyads, each of another draw of the posterior, {blocks}"
            yield predictions_part("posterior", title, found[name], performances, "fitted")
    yield models_part(found, "fitted", "posterior-models")
    yield differences_part(found, "posterior-differences")
