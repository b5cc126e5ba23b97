"""A fit as tables, and as the posterior that cohorts draw participants from."""

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from netboard.analysis.cohort.posterior import Posterior
from netboard.analysis.cohort.workers import CODE
from netboard.analysis.extraction.fingerprint import fingerprint
from netboard.analysis.inference.fit import LEVELS, Fit
from netboard.analysis.inference.priors import NAMES, PRIORS, values_of
from netboard.analysis.inference.summaries import DYADS, SUMMARIES
from netboard.base.config import Config, digest
from netboard.base.errors import writing
from netboard.base.files.new import refuse_existing
from netboard.base.settings import tables

LIMITS = (2.5, 50.0, 97.5)
"""Percentiles that the tables give [%]."""

CONDITION = "bimanual, haptics off"


def posterior_of(fit: Fit) -> Posterior:
    """Return the posterior, with the identity of the fit."""
    request = fit.request
    about = {
        "netboard": version("netboard"),
        "code_sha256": fingerprint(CODE),
        "config_sha256": digest(request.config),
        "condition": CONDITION,
        "seed": request.seed,
        "designs": request.designs,
        "calibrations": request.calibrations,
        "summaries": {one.name: {"value": one.value, "unit": one.unit, "log_sd": one.tolerance} for one in SUMMARIES},
        "priors": {
            name: {"median": one.median, "log_sd": one.spread, "floor": one.floor} for name, one in PRIORS.items()
        },
    }
    return Posterior(NAMES, values_of(fit.kept), about)


def write(folder: Path, fit: Fit) -> list[dict[str, Any]]:
    """Write posterior.json and fit.json to a new folder; return the tables."""
    refuse_existing(folder)
    parts = list(parts_of(fit))
    with writing(folder):
        folder.mkdir(parents=True)
        (folder / "posterior.json").write_text(posterior_of(fit).text(), encoding="utf-8")
        text = json.dumps({"parts": parts}, indent=1, ensure_ascii=False, allow_nan=False)
        (folder / "fit.json").write_text(text + "\n", encoding="utf-8")
    return parts


def parts_of(fit: Fit) -> Iterator[dict[str, Any]]:
    """Yield the tables: what was fitted to, the parameters, and the recovery of known ones."""
    yield _part(
        "summaries",
        f"Summaries: {CONDITION}, {2 * DYADS} participants; {len(fit.predicted.scores)} draws of the posterior",
        ("summary", "paper", "emulator R2", "predicted", "2.5 %", "97.5 %", "inside"),
        _summaries(fit),
    )
    yield _part(
        "parameters",
        f"Posterior of {len(NAMES)} parameters: medians and central 95 %",
        ("key", "unit", "prior", "95 %", "posterior", "95 %", "contraction", "source of the prior"),
        _parameters(fit),
    )
    yield _part(
        "recovery",
        f"Recovery of {len(fit.recovery.truths)} simulated truths",
        ("key", "correlation", "contraction", *(f"coverage of {level:.0%}" for level in LEVELS)),
        _recovery(fit),
    )
    yield _part("fit", "Size and convergence of the fit", ("", "value"), _sizes(fit))


def _part(name: str, title: str, columns: tuple[str, ...], rows: Iterator[list[Any]]) -> dict[str, Any]:
    return {"name": name, "title": title, "columns": columns, "rows": list(rows), "verdicts": []}


def _summaries(fit: Fit) -> Iterator[list[Any]]:
    low, middle, high = np.exp(np.percentile(fit.predicted.summaries, LIMITS, axis=0))
    for place, one in enumerate(SUMMARIES):
        inside = "yes" if low[place] <= one.value <= high[place] else "NO"
        numbers = (fit.emulator.explained[place], middle[place], low[place], high[place])
        unit = "" if one.unit == "1" else f" [{one.unit}]"
        yield [f"{one.name}{unit}", one.value, *map(float, numbers), inside]


def _parameters(fit: Fit) -> Iterator[list[Any]]:
    (units,) = ({key.name: key.unit for key in table.keys} for table in tables(Config) if table.name == "participant")
    contraction = 1.0 - fit.chains.scores.var(axis=0)
    for place, (name, prior) in enumerate(PRIORS.items()):
        known = prior.value(np.array([-1.96, 0.0, 1.96]))
        found = prior.value(np.percentile(fit.chains.scores[:, place], LIMITS))
        each = [text for low, middle, high in (known, found) for text in (f"{middle:.3g}", f"{low:.3g} to {high:.3g}")]
        yield [name, units[name], *each, float(contraction[place]), prior.source]


def _recovery(fit: Fit) -> Iterator[list[Any]]:
    found = fit.recovery
    contraction = 1.0 - (found.deviations**2).mean(axis=0)
    for place, name in enumerate(NAMES):
        correlation = np.corrcoef(found.truths[:, place], found.means[:, place])[0, 1]
        covered = found.covered[:, :, place].mean(axis=1)
        yield [name, float(correlation), float(contraction[place]), *(f"{share:.2f}" for share in covered)]
    shares, count = found.covered.mean(axis=2), len(found.truths)
    errors = shares.std(axis=1, ddof=1) / np.sqrt(count)
    all_of = [f"{share:.3f} +- {error:.3f}" for share, error in zip(shares.mean(axis=1), errors, strict=True)]
    yield ["all, with standard error", "", float(contraction.mean()), *all_of]


def _sizes(fit: Fit) -> Iterator[list[Any]]:
    request = fit.request
    yield ["designs for the emulator", request.designs]
    yield ["of these given up", fit.designs.given_up]
    yield ["calibrations, each with random numbers of its own", request.calibrations]
    yield ["samples of the posterior", len(fit.chains.scores)]
    yield ["largest autocorrelation time [steps]", round(fit.chains.steps_apart)]
    yield ["seed", request.seed]
