"""Models of all trials at once: completion times, velocity peaks and falls over forces, configuration and practice.

The models are those of `netboard.analysis.models`; here they are given a study, and their terms, notes and assumptions
become results. All forces that are felt are one level of a model; the contrasts tell them apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from netboard.analysis.effects import Effect, Inference, Model
from netboard.analysis.factors import INTERCEPT, PRACTICE, Factor, paper_factors
from netboard.analysis.models import count_model, log_time_model, share_model
from netboard.findings.measures import rows_of
from netboard.findings.results import Result, kept
from netboard.measuring.study import Study


@dataclass(frozen=True, slots=True)
class Fit:
    """A model of a measure.

    Attributes
    ----------
    measure : str
        What is modelled.
    of : str
        What was counted: trials or attempts.
    ratio, first : str
        What the exponentials of a coefficient, and of the intercept, are.
    model : Model
        The model, fitted or not.
    """

    measure: str
    of: str
    ratio: str
    first: str
    model: Model


@dataclass(frozen=True, slots=True)
class Fits:
    """All models.

    Attributes
    ----------
    fits : tuple of Fit
        Of completion times, velocity peaks and falls.
    notes : tuple of str
        What was left out of all of them.
    """

    fits: tuple[Fit, ...]
    notes: tuple[str, ...]

    @property
    def results(self) -> tuple[Result, ...]:
        """Each term with its p, the sources of chance, and what speaks against the assumptions."""
        return tuple(row for fit in self.fits for row in (*self._terms(fit), *_chance(fit), *_checks(fit)))

    def _terms(self, fit: Fit) -> Iterator[Result]:
        note = "; ".join((f"{fit.model.name}: {fit.model.equation}", *self.notes, *fit.model.notes))
        for effect in fit.model.effects:
            yield from _rows(fit, effect, effect, "", note)
            for other in effect.others:
                yield from _rows(fit, effect, other, f", {other.method}", note)


def _rows(fit: Fit, effect: Effect, sure: Effect | Inference, method: str, note: str) -> Iterator[Result]:
    """A term with its interval, and its p, by one method."""
    (value, low, high), unit = _shown(effect.name, sure), "1"
    interval = f"95 % {sure.estimate.method}" if np.isfinite(low) else ""
    rest = (sure.estimate.n, "dyad", note)
    quantity = f"{fit.measure}: {fit.ratio}"
    if effect.name == PRACTICE:
        quantity = f"{fit.measure}: exponent of practice"
    elif effect.name == INTERCEPT:
        quantity, unit = f"{fit.measure}: {fit.first}", "s" if fit.measure == "completion time" else "1"
    yield Result("models", f"{quantity}{method}", effect.name, value, low, high, unit, interval, *rest)
    yield Result("models", f"{fit.measure}: p{method}", effect.name, sure.p, np.nan, np.nan, "1", "", *rest)


def _shown(name: str, sure: Effect | Inference) -> tuple[float, float, float]:
    """Return a term as what it multiplies; practice as its exponent."""
    of = sure.estimate if name == PRACTICE else sure.ratio
    return of.value, of.low, of.high


def _chance(fit: Fit) -> Iterator[Result]:
    for component in fit.model.components:
        numbers = (component.deviation, np.nan, np.nan, "1", "", component.levels)
        of = "trial" if component.name == "residual" else component.name.split(" by ")[-1]
        yield Result("models", f"{fit.measure}: SD on the log scale", component.name, *numbers, of)


def _checks(fit: Fit) -> Iterator[Result]:
    """Numbers beside the assumptions that they speak of; the rest of these is a note."""
    model = fit.model
    checks = [("correlation within dyads", model.correlation), ("Pearson's dispersion", model.dispersion)]
    if model.diagnostics is not None:
        found = model.diagnostics
        checks += [("residual skewness", found.skewness), ("residual kurtosis", found.kurtosis)]
        checks += [("rank correlation of residual size and fit", found.spread)]
        checks += [("correlation of successive residuals", found.successive)]
    note = " ".join(("Assumptions:", *model.assumptions))
    for name, value in checks:
        if np.isfinite(value):
            yield Result(
                "models", f"{fit.measure}: {name}", "all", value, np.nan, np.nan, "1", "", model.trials, fit.of, note
            )


@kept
def fits(study: Study) -> Fits:
    """Fit all models.

    Parameters
    ----------
    study : Study
        The study; trials with a robot or a hand that is still are left out.

    Returns
    -------
    Fits
        The models. One that cannot be fitted says why in its notes.
    """
    trials, attempts = (_people(rows_of(study, of)) for of in ("trial", "attempt"))
    attempts = attempts.assign(order=_number_of(attempts))
    times = log_time_model(trials["completion"].where(trials["completion"] > 0.0), *_labels(trials))
    peaks = count_model(trials["peaks"], *_labels(trials))
    falls = share_model(attempts["outcome"] == "fell", *_labels(attempts))
    return Fits(
        (
            Fit("completion time", "trial", "ratio", "at the first trial", times),
            Fit("velocity peaks", "trial", "ratio", "at the first trial", peaks),
            Fit("falls per attempt", "attempt", "ratio of odds", "odds at the first trial", falls),
        ),
        _left_out(study, len(trials), trials),
    )


def _people(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows["condition"] == rows["configuration"] + ", " + rows["force"]]


def _labels(rows: pd.DataFrame) -> tuple[pd.Series, pd.Series, tuple[Factor, ...], pd.Series]:
    return rows["dyad"], rows["performer"], factors_of(rows), rows["order"]


def factors_of(rows: pd.DataFrame) -> tuple[Factor, ...]:
    """Return the fixed factors of the models: haptics and configuration.

    Parameters
    ----------
    rows : DataFrame
        Rows of the table of trials.

    Returns
    -------
    tuple of Factor
        What each row has of them.
    """
    return paper_factors(rows["haptics"] == 1, rows["configuration"] == "dyadic")


def _number_of(attempts: pd.DataFrame) -> pd.Series:
    """Number attempts by the successful trial of the performer in the condition that they are at, from 1."""
    succeeded = (attempts["outcome"] == "success").astype("int64")
    done = succeeded.groupby([attempts[name] for name in ("dyad", "performer", "condition")]).cumsum()
    return done - succeeded + 1


def _left_out(study: Study, kept: int, trials: pd.DataFrame) -> tuple[str, ...]:
    """Say what the models do not tell apart or leave out."""
    notes = []
    if kept < len(study.counted):
        notes.append(f"{len(study.counted) - kept} trials with a robot or a still hand are left out")
    felt = sorted(trials.loc[trials["haptics"] == 1, "force"].unique())
    if len(felt) > 1:
        notes.append(f"haptics: {', '.join(felt)} together")
    return tuple(notes)
