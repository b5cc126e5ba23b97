"""Power of the models of all trials: each is fitted to the first dyads of every virtual study, as to a real study.

A model takes seconds, so only one study of each size is taken from a virtual study. The false-positive rate is the
share of studies whose confidence interval misses the mean estimate of the whole cohort: in those, a test of the true
value would reject. A model that cannot be fitted rejects nothing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import exp, log, nan
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from netboard.analysis.cohort.folder import MANIFEST, Cohort
from netboard.analysis.cohort.power import Power, PowerRate, mean_width
from netboard.analysis.cohort.workers import Runner
from netboard.analysis.extraction.conditions import factor_read
from netboard.analysis.statistics.factors import INTERCEPT, PRACTICE
from netboard.analysis.topics.models import ModelFit, fits_of, human_test_rows, trial_numbers
from netboard.base.errors import ConfigError

MODEL = "model"
"""Name of the test with the between-dyad degrees of freedom."""


class FitKey(NamedTuple):
    """Key of a term: number of dyads, measure, effect, and method of inference."""

    dyads: int
    measure: str
    effect: str
    method: str


@dataclass(frozen=True, slots=True)
class Term:
    """An effect in one study: a ratio with its confidence interval, its p value, and whether the fit converged."""

    value: float
    low: float
    high: float
    p: float
    converged: bool


def fitted(folder: Path, sizes: Sequence[int], alpha: float, trials: int, number: int) -> dict[FitKey, Term]:
    """Fit all models to a virtual study with each number of dyads.

    - `trials`: first trials of each condition that count; 0 for all [1].
    - `number`: number of the virtual study [1].
    """
    packed = Cohort(folder).get(number)
    rows = human_test_rows(pd.DataFrame(packed.tables["trials"], copy=False))
    attempts = rows[(rows["excluded"] == 0) & rows["outcome"].isin(["success", "fell"])]
    attempts = attempts.assign(order=trial_numbers(attempts))
    if trials:
        attempts = attempts[attempts["order"] <= trials]
    dyad = attempts["dyad"].str[1:].astype(int)
    factors = list(map(factor_read, packed.factors))
    found: dict[FitKey, Term] = {}
    for size in sizes:
        own = attempts[dyad <= size]
        for fit in fits_of(own[own["counts"] == 1], own, factors, 1.0 - alpha):
            found |= {FitKey(size, fit.measure, effect, method): term for effect, method, term in _terms(fit)}
    return found


def _terms(fit: ModelFit) -> Iterator[tuple[str, str, Term]]:
    """Yield the effects of a model, by each of its methods."""
    for effect in fit.model.effects:
        if effect.name not in (INTERCEPT, PRACTICE):
            ratio = effect.ratio
            yield effect.name, MODEL, Term(ratio.value, ratio.low, ratio.high, effect.p, fit.model.converged)
            for other in effect.others:
                ratio = other.ratio
                found = Term(ratio.value, ratio.low, ratio.high, other.p, fit.model.converged)
                yield effect.name, f"{MODEL}, {other.method}", found


def model_powers(
    cohort: Cohort, studies: int, sizes: Sequence[int], alpha: float, trials: int, runner: Runner
) -> list[Power]:
    """Fit all models to all studies, and return the power of each effect."""
    if not cohort.manifest["keep_trials"]:
        raise ConfigError(f"--models: {cohort.folder} has no trials, expected a cohort that was made with --trials")
    task = partial(fitted, cohort.folder.absolute(), tuple(sizes), alpha, trials)
    found: dict[int, dict[FitKey, Term]] = {}
    files = [cohort.folder.absolute() / MANIFEST]
    for number, terms in runner.run_all(task, range(1, studies + 1), files):
        found[number] = terms
        runner.progress(f"models of {len(found)} of {studies} studies", len(found), studies)
    each = [found[number] for number in sorted(found)]
    keys = dict.fromkeys(key for terms in each for key in terms)
    return [
        _power(key, [terms.get(key) for terms in each], _truth(key, each, max(sizes)), alpha, trials)
        for key in sorted(keys, key=lambda key: (key.measure, key.effect, key.method))
    ]


def _truth(key: FitKey, each: Sequence[Mapping[FitKey, Term]], largest: int) -> float:
    """Return the geometric mean of an effect over all studies with the largest number of dyads."""
    values = [
        log(term.value)
        for terms in each
        for own, term in terms.items()
        if (own.dyads, own.measure, own.effect) == (largest, key.measure, key.effect)
        if np.isfinite(term.value) and term.value > 0.0
    ]
    return exp(float(np.mean(values))) if values else nan


def _power(key: FitKey, terms: Sequence[Term | None], truth: float, alpha: float, trials: int) -> Power:
    """Count rejections and misses."""
    known = [term for term in terms if term is not None]
    hits = sum(term.p <= alpha for term in known)
    misses = sum(truth < term.low or truth > term.high for term in known)
    ends = np.array([(term.low, term.high) for term in known]).reshape(-1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        widths = np.log(ends[:, 1]) - np.log(ends[:, 0])
    width, error = mean_width(widths, "ratio")
    return Power(
        measure=key.measure,
        contrast=key.effect,
        test=key.method,
        dyads=key.dyads,
        trials=trials,
        studies=len(terms),
        unit="1",
        scale="ratio",
        effect=truth,
        deviation=nan,
        power=PowerRate.of(hits, len(terms)),
        false_positives=PowerRate.of(misses, len(terms)),
        width=width,
        width_error=error,
        unconverged=sum(not term.converged for term in known) / len(terms),
    )
