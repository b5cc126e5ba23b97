"""``netboard bench analysis --calibration``: false positives of the tests of a study beside .05, and their power."""

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

import numpy as np
from scipy import stats

from netboard.benchmarks.analysis.calibration import (
    ALONE,
    DYADS,
    EFFECT,
    ERRORS,
    LEVEL,
    METHODS,
    OF_DYADS,
    OF_PERFORMERS,
    OF_TRIALS,
    SLOPES,
    TERMS,
    TRIALS,
    Array,
    Setting,
    differences_alone,
    settings,
    simulated,
)
from netboard.benchmarks.harness.results import Folder, Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell

STUDIES, QUICK, PORTION = 2000, 60, 100
"""Simulated studies of each kind, in the short form, and of one task of a process [1]."""

LIBERAL = 0.075
"""A test at .05 that rejects more than this is called liberal (Bradley, Brit. J. Math. Stat. Psychol. 31:144, 1978)."""

Counts = dict[Setting, Array]
"""Of each kind of study: how many are rejected, (no effect and effect, term, method) and how many were simulated."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Simulate, and write the tables."""
    del folder
    studies = QUICK if quick else STUDIES
    counts = rejected(studies, tell)
    yield about_part(studies)
    yield table_part(counts, studies, 0, 0)
    yield table_part(counts, studies, 1, 0)
    yield table_part(counts, studies, 0, 1)
    yield differences_part(ALONE * studies)


def rejected(studies: int, tell: Tell) -> Counts:
    """Simulate all kinds of studies, on all cores, and count what each test rejects."""
    every = settings()
    tasks = [
        (setting, min(PORTION, studies - first), (kind, first))
        for kind, setting in enumerate(every)
        for first in range(0, studies, PORTION)
    ]
    # The large ones first, so that no process is alone with one in the end.
    tasks.sort(key=lambda task: -task[0].dyads)
    counts = {setting: np.zeros((2, len(TERMS), len(METHODS))) for setting in every}
    with ProcessPoolExecutor(min(os.cpu_count() or 1, len(tasks)), get_context("spawn")) as pool:
        asked = {pool.submit(_rejections, *task): task[0] for task in tasks}
        for done, answer in enumerate(as_completed(asked), start=1):
            counts[asked[answer]] += answer.result()
            tell(f"{done} of {len(tasks)} portions", done / len(tasks))
    return counts


def _rejections(setting: Setting, studies: int, seed: tuple[int, ...]) -> Array:
    """A p that is not a number rejects nothing."""
    return np.asarray((simulated(setting, studies, seed) <= LEVEL).sum(axis=-1), dtype=float)


def about_part(studies: int) -> Part:
    """Say what is simulated."""
    rows: list[tuple[Value, ...]] = [
        ("simulated studies of each kind", studies),
        ("dyads", ", ".join(map(str, DYADS))),
        ("performers of a dyad, trials of each with and without forces", f"3, {TRIALS}"),
        ("SD of dyads, performers and trials [log]", f"{OF_DYADS:g}, {OF_PERFORMERS:g}, {OF_TRIALS:g}"),
        ("SD of the haptic effect, of dyads and of performers [log]", " or ".join(f"{one:g}" for one in SLOPES)),
        ("effect whose power is told [log]", f"{EFFECT:g}"),
        ("tests reject at p", LEVEL),
    ]
    return Part("about", "What was simulated", ("", "of what"), rows)


TITLES = {
    (0, 0): ("false-positives", "False positives of the test of haptics at .05, with 95 % Monte-Carlo intervals"),
    (1, 0): ("power", f"Power of the test of haptics at .05, effect {EFFECT:g} on the log scale"),
    (0, 1): ("interaction", "False positives of the test of haptics x configuration at .05"),
}


def table_part(counts: Counts, studies: int, place: int, term: int) -> Part:
    """Write what share of the studies each test rejects.

    - `place`, `term`: without or with an effect, and number of the term [1].
    """
    name, title = TITLES[place, term]
    rows: list[tuple[Value, ...]] = []
    for setting, found in counts.items():
        cells = [share(int(count), studies) for count in found[place, term]]
        rows.append((setting.dyads, setting.errors, f"{setting.slopes:g}", *cells))
    verdicts = _verdicts(counts, studies) if (place, term) == (0, 0) else []
    heads = ("dyads", "errors", "SD of effect [log]", *METHODS)
    return Part(name, title, heads, rows, verdicts)


def differences_part(samples: int) -> Part:
    """Write what share of samples of dyads' differences the paired tests reject, where their mean is zero."""
    rows: list[tuple[Value, ...]] = []
    worst: dict[str, list[float]] = {"normal": [], "skewed": []}
    for kind, errors in enumerate(name for name in ERRORS if not name.startswith("AR")):
        for dyads in DYADS:
            p = differences_alone(dyads, errors, samples, (kind, dyads))
            counts = (p <= LEVEL).sum(axis=1)
            rows.append((dyads, errors, *(share(int(count), samples) for count in counts)))
            if errors in worst:
                worst[errors].append(float(counts[1]) / samples)
    verdict = Verdict(
        "the permutation test keeps .05 where differences are symmetric, and does not where they are skewed",
        max(worst["normal"]) <= LIBERAL < max(worst["skewed"]),
        f"at most {max(worst['normal']):.3f} of normal ones, and up to {max(worst['skewed']):.3f} of log-normal ones",
    )
    title = f"False positives of tests of dyads' differences, {samples} samples of each kind"
    return Part("differences", title, ("dyads", "differences", *METHODS[3:]), rows, [verdict])


def share(count: int, of: int) -> str:
    """Write a share with its interval of Clopper and Pearson."""
    found = stats.binomtest(count, of).proportion_ci(method="exact")
    return f"{count / of:.3f} ({found.low:.3f}-{found.high:.3f})"


def _verdicts(counts: Counts, studies: int) -> list[Verdict]:
    """Say which tests of the mixed model keep what they promise under normal errors."""
    normal = {setting: found[0, 0] / studies for setting, found in counts.items() if setting.errors == "normal"}
    verdicts = []
    for method in ("careful", "Satterthwaite", "Kenward-Roger"):
        rates = [float(found[METHODS.index(method)]) for found in normal.values()]
        claim = f"with normal errors {method} rejects no more than {LIBERAL:g} where there is no effect"
        # The short form is too short to tell .05 from .075: it allows for its own error.
        slack = 3.0 * (LEVEL * (1.0 - LEVEL) / studies) ** 0.5 if studies < STUDIES else 0.0
        verdicts.append(Verdict(claim, max(rates) <= LIBERAL + slack, f"{min(rates):.3f} to {max(rates):.3f}"))
    return verdicts
