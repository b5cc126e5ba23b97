"""Measure how often the models' intervals hold the truth: a table of docs/explanation/analysis-modern.md, to copy.

    python docs/model_coverage.py [STUDIES]

Studies are drawn whose effects are known, with 4, 8 and 16 dyads of three performers (two participants and the dyad),
30 trials with each force; the models of `netboard.analysis.statistics.models` are fitted to them. In some, dyads and
performers are alike, or differ but not in the effect of forces. 400 take half an hour.
"""

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from netboard.analysis.statistics.effects import Model
from netboard.analysis.statistics.factors import paper_factors
from netboard.analysis.statistics.models import count_model, log_time_model, share_model

EFFECTS = {"haptics": -0.1, "configuration": -0.1, "haptics x configuration": -0.1, "log trial": -0.1}
INTERCEPT, TRIALS, DYADS = 1.5, 30, (4, 8, 16)
TRUTH = {"intercept": INTERCEPT, **EFFECTS}
OF_DYADS, OF_PERFORMERS, OF_TRIALS, OF_SLOPES = 0.2, 0.1, 0.5, 0.08
"""Standard deviations: intercepts of dyads and of performers, trials, and haptic effects of both [log]."""


@dataclass(frozen=True)
class Drawn:
    """A study: labels of each trial, and the logarithm of what is expected of it."""

    labels: tuple[Any, ...]
    expected: NDArray[np.float64]


def draw(
    rng: np.random.Generator,
    dyads: int,
    slopes: float,
    of_dyads: float = OF_DYADS,
    of_performers: float = OF_PERFORMERS,
) -> Drawn:
    """Draw a study with known effects."""
    parts = []
    for dyad in range(dyads):
        of_dyad, slope = rng.normal(0, of_dyads), rng.normal(0, slopes)
        for performer in range(3):
            own, own_slope = rng.normal(0, of_performers), rng.normal(0, slopes)
            together = 0.5 if performer == 2 else -0.5
            for felt in (-0.5, 0.5):
                order = np.arange(1, TRIALS + 1)
                fixed = EFFECTS["haptics"] * felt + EFFECTS["configuration"] * together
                fixed += EFFECTS["haptics x configuration"] * felt * together
                line = INTERCEPT + fixed + EFFECTS["log trial"] * np.log(order)
                line = line + of_dyad + own + (slope + own_slope) * felt
                labels = (np.full(TRIALS, value) for value in (dyad, performer, felt > 0, together > 0))
                parts.append(np.column_stack([*labels, order, line]))
    dyad, performer, felt, together, order, line = np.vstack(parts).T
    return Drawn((dyad, performer, paper_factors(felt > 0, together > 0), order), line)


def fits(rng: np.random.Generator, dyads: int) -> dict[str, Model]:
    """Fit each model to a study that is drawn for it."""
    varied = draw(rng, dyads, OF_SLOPES)
    times = np.exp(varied.expected + rng.normal(0, OF_TRIALS, len(varied.expected)))
    counts = rng.poisson(np.exp(varied.expected - 0.5) * rng.gamma(3, 1 / 3, len(varied.expected)))
    failed = rng.random(len(varied.expected)) < 1 / (1 + np.exp(3.2 - varied.expected))
    same, alike = draw(rng, dyads, 0.0), draw(rng, dyads, 0.0, 0.0, 0.0)
    others = {"the same for all": same, "all alike": alike}
    return {
        "times": log_time_model(times, *varied.labels),
        "no slopes": log_time_model(times, *varied.labels, slopes="none"),
        "counts": count_model(counts, *varied.labels),
        "failures": share_model(failed, *varied.labels),
        **{
            name: log_time_model(np.exp(drawn.expected + rng.normal(0, OF_TRIALS, len(times))), *drawn.labels)
            for name, drawn in others.items()
        },
    }


def main(studies: int = 400) -> None:
    """Print how often the intervals of z and of t hold an effect: of times all effects, else that of haptics."""
    for dyads in DYADS:
        quantiles = {"z": stats.norm.ppf(0.975), "t": stats.t.ppf(0.975, dyads - 1)}
        held: dict[tuple[str, str, str], list[bool]] = {}
        for seed in range(studies):
            for name, model in fits(np.random.default_rng((seed, dyads)), dyads).items():
                for effect in TRUTH if name == "times" else ("haptics",):
                    found = model.effect(effect)
                    off = abs(found.estimate.value - TRUTH[effect])
                    for kind, quantile in quantiles.items():
                        held.setdefault((name, effect, kind), []).append(bool(off <= quantile * found.error))
        for (name, effect, kind), hits in held.items():
            sys.stdout.write(f"{dyads} dyads, {name}, {effect}, {kind}: {np.mean(hits):.2f} of {len(hits)}\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
