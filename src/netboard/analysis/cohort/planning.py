"""How large must a study be? Simulates a cohort of it, or takes one, and answers with power, figure and sentences."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from netboard.analysis.cohort.decisions import CohortDecision, decision_of, declared_powers
from netboard.analysis.cohort.fits import model_powers
from netboard.analysis.cohort.folder import Cohort, make_cohort
from netboard.analysis.cohort.posterior import Posterior
from netboard.analysis.cohort.power import Power, differences, levels_of_cohort, powers
from netboard.analysis.cohort.report import Assumptions, by_test, distributions, parts, sentence, write
from netboard.analysis.cohort.rows import SIZE
from netboard.analysis.cohort.virtual import VirtualDesign
from netboard.analysis.cohort.workers import Runner
from netboard.analysis.extraction.conditions import factor_read
from netboard.base.config import Config, digest, parse
from netboard.base.errors import ConfigError
from netboard.base.files.new import refuse_existing
from netboard.task.studies.declaration import declaration_of
from netboard.task.studies.study import Study, resolve_study


@dataclass(frozen=True, slots=True)
class Request:
    """The request: study, numbers of dyads and trials, and contrasts.

    - `dyads`, `trials`: numbers of dyads; first trials of each condition, 0 for all [1].
    - `contrasts`: texts in ``measure: contrast``; empty for all contrasts.
    - `models`: whether models of all trials are fitted, too.
    - `posterior`: of the usual participant, over whose draws an assurance is averaged; None for no assurance.
    """

    study: Study
    config: Config
    dyads: tuple[int, ...]
    trials: tuple[int, ...]
    studies: int
    seed: int
    alpha: float
    contrasts: tuple[str, ...] = ()
    models: bool = False
    posterior: Posterior | None = None

    @property
    def design(self) -> VirtualDesign:
        """The cohort to simulate, with equal usual participants in all studies."""
        return VirtualDesign(self.study, self.config, max(self.dyads), self.seed, keep_trials=self.models)


@dataclass(frozen=True, slots=True)
class PowerAnswer:
    """The tables of a page, and a sentence on the primary contrast, or on the first one if none is declared."""

    parts: list[dict[str, Any]]
    sentence: str


def answer(request: Request, folder: Path, given: Path | None, runner: Runner) -> PowerAnswer:
    """Compute the powers, and write them to a new folder.

    - `given`: folder of a cohort of the study; None simulates one, in ``cohort`` of the new folder.
    """
    refuse_existing(folder)
    if given is None:
        cohort = make_cohort(request.design, request.studies, folder / "cohort", runner)
    else:
        cohort = suitable(request, given)
    studies = cohort.finished
    every = [_of_contrasts(request, cohort, studies, trials) for trials in request.trials]
    found = [one for powers_of, _ in every for one in powers_of]
    if request.models:
        for trials in request.trials:
            found += model_powers(cohort, studies, request.dyads, request.alpha, trials, runner)
    made = cohort.manifest
    config = parse(made["config"], str(cohort.folder))
    drawn = tuple(distributions(config, made["seed"]))
    assumptions = Assumptions(
        study=made["study"],
        netboard=made["netboard"],
        config_sha256=digest(config),
        seed=made["seed"],
        studies=studies,
        dyads=made["dyads"],
        alpha=request.alpha,
        parameters=drawn,
        decision=every[0][1],
        posterior=made.get("posterior"),
        assurance=None if request.posterior is None else request.posterior.sha256,
    )
    assured = _assured(request, folder / "assurance", runner)
    write(folder, found, assumptions, assured)
    return PowerAnswer(parts(found, assumptions, assured), sentence(next(iter(by_test(found).values())), assumptions))


def _assured(request: Request, folder: Path, runner: Runner) -> list[Power]:
    """Return the powers of a cohort whose usual participants are draws of the posterior; none without one."""
    if request.posterior is None:
        return []
    design = replace(request.design, posterior=request.posterior, keep_trials=False)
    cohort = make_cohort(design, request.studies, folder, runner)
    return [one for trials in request.trials for one in _of_contrasts(request, cohort, request.studies, trials)[0]]


def suitable(request: Request, folder: Path) -> Cohort:
    """Open a cohort.

    - raises ConfigError: if it is of another study, has too few dyads, or no finished study.
    """
    cohort = Cohort(folder)
    if cohort.manifest["plan"] != resolve_study(request.study):
        found = cohort.manifest["study"]
        raise ConfigError(f"--cohort {folder}: is of the study {found}, or of another version of {request.study.name}")
    most = cohort.manifest["dyads"]
    if max(request.dyads) > most:
        raise ConfigError(f"--dyads: found {max(request.dyads)}, expected at most {most}, those of {folder}")
    if not cohort.finished:
        raise ConfigError(f"--cohort {folder}: has no finished study; continue it with netboard cohort --resume")
    return cohort


def _of_contrasts(request: Request, cohort: Cohort, studies: int, trials: int) -> tuple[list[Power], CohortDecision]:
    """Return the powers of the chosen contrasts with a number of trials, those of the declared tests first."""
    first = cohort.get(1)
    most = SIZE * int(first.tables["groups"]["group"].max(initial=0))
    if trials > most:
        raise ConfigError(f"--trials: found {trials}, expected at most {most}, those of a condition")
    levels = levels_of_cohort(cohort.frames("groups", studies), trials)
    factors = list(map(factor_read, first.factors))
    decision = decision_of(levels, factors, declaration_of(request.study))
    gaps = differences(levels, first.contrasts)
    names = [f"{one.measure}: {one.effect}" for one in decision.scores]
    names += [f"{one.measure}: {one.contrast}" for one in gaps]
    chosen = _chosen(names, request.contrasts)
    # A declared test is decided among all declared ones, chosen or not.
    declared = declared_powers(decision, request.dyads, request.alpha, trials)
    found = [one for one in declared if f"{one.measure}: {one.contrast}" in chosen]
    wanted = [one for one in gaps if f"{one.measure}: {one.contrast}" in chosen]
    return [*found, *powers(wanted, request.dyads, request.alpha, trials)], decision


def _chosen(names: Sequence[str], texts: Sequence[str]) -> set[str]:
    """Return the names of contrasts with one of the texts; all without a text."""
    if not names:
        raise ConfigError(
            "--contrast: no dyad of this study has both conditions of a contrast; expected a study with such conditions"
        )
    for text in texts:
        if not any(text.casefold() in name.casefold() for name in names):
            raise ConfigError(f"--contrast: found {text!r}, expected a part of one of {'; '.join(names)}")
    return {name for name in names if not texts or any(text.casefold() in name.casefold() for text in texts)}
