"""One virtual study: draws its dyads, simulates their plan and measures them; a pure function of design and number.

Virtual study k of a cohort with seed S has the seed ``S * SPACING + k`` for its plans, participants and ticks, so no
two studies share one, in one cohort or in two. ``netboard session rehearse --seed`` with that number records the same
dyads.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from typing import Any

from netboard.analysis.cohort.block import READINGS, measured, rehearse
from netboard.analysis.cohort.posterior import Posterior
from netboard.analysis.cohort.rows import attempt_rows, fields_of, group_rows, push_rows
from netboard.analysis.extraction.cache import Streams
from netboard.analysis.extraction.recordings import Measured
from netboard.analysis.extraction.study import StudyData as Tables
from netboard.analysis.extraction.study import study_of
from netboard.analysis.extraction.tables import Columns, written
from netboard.analysis.topics.contrasts import questions_of
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.settings import parse_json
from netboard.base.tick import TICK_SECONDS
from netboard.nodes.rehearsal.jobs import RehearsalJob, jobs_of
from netboard.participants.seat.block import Rehearsal
from netboard.recording.format.channels import Field
from netboard.task.plans.plan import blocks_of
from netboard.task.studies.study import Study

SPACING = 1_000_000
"""Number of seeds reserved for each cohort; a cohort must be smaller [1]."""

LAST_SEED = (2**31 - 1) // SPACING - 1
"""Largest seed of a cohort [1]."""


@dataclass(frozen=True, slots=True)
class VirtualDesign:
    """The simulated design: plan, participants, and number of dyads in each virtual study.

    - `config`: rig, scene and participants.
    - `keep_trials`: whether the tables have a row for each attempt, too.
    - `posterior`: of which the usual participant of each study is a draw; None for that of the configuration.
    """

    study: Study
    config: Config
    dyads: int
    seed: int
    keep_trials: bool = False
    posterior: Posterior | None = None

    def __post_init__(self) -> None:
        if self.dyads < 1:
            raise ConfigError(f"--dyads: found {self.dyads}, expected 1 or more")
        if not 0 <= self.seed <= LAST_SEED:
            raise ConfigError(f"--seed: found {self.seed}, expected 0 to {LAST_SEED}")

    def seed_of(self, number: int) -> int:
        """Return the seed of a virtual study [1]."""
        return self.seed * SPACING + number

    def config_of(self, number: int) -> Config:
        """Return the configuration of a virtual study, with its usual participant."""
        if self.posterior is None:
            return self.config
        person = self.posterior.participant(self.config.participant, self.seed_of(number))
        return replace(self.config, participant=person)


def jobs_of_dyad(config: Config, study: Study, seed: int, dyad: int) -> list[RehearsalJob]:
    """Return the blocks of a dyad, in order, each with its participants; nothing of them is recorded."""
    return jobs_of(blocks_of(config, study, seed, dyad), seed, dyad, None)


def compile_kernels(jobs: Sequence[RehearsalJob]) -> None:
    """Compile the kernels of blocks, or load them from the cache, by running a tick of each."""
    for job in jobs:
        next(Rehearsal(job.config, job.people).pieces(1))


def check(design: VirtualDesign, studies: int) -> None:
    """Refuse a cohort that cannot be simulated.

    - raises ConfigError: if there are no studies or too many, or a block of a plan has no valid configuration or cannot
      be simulated.
    """
    if not 1 <= studies < SPACING:
        raise ConfigError(f"--studies: found {studies}, expected 1 to {SPACING - 1}")
    for dyad in range(1, design.dyads + 1):
        for job in jobs_of_dyad(design.config, design.study, design.seed_of(1), dyad):
            block = job.config.block
            where = f"{design.study.name}: dyad {dyad}, block {block.number} ({block.label})"
            if job.config.physics.balls == 0:
                raise ConfigError(f"{where}: [physics] balls: found 0, expected 1 or more: a trial needs a ball")
            if block.force == "unrelated":
                raise ConfigError(f'{where}: [block] force: found "unrelated", which takes recorded forces')


def simulate(design: VirtualDesign, number: int) -> bytes:
    """Simulate and measure a virtual study; return its packed tables.

    - `number`: number of the study in the cohort, from 1 [1].
    """
    config, seed = design.config_of(number), design.seed_of(number)
    tables, given_up, ticks, perturbed = [], 0, 0, False
    for dyad in range(1, design.dyads + 1):
        for place, job in enumerate(jobs_of_dyad(config, design.study, seed, dyad), start=1):
            found = rehearse(job)
            tables.append(measured(job, place, found))
            given_up, ticks = given_up + found.given_up, ticks + found.ticks
            perturbed |= bool(job.config.perturbation.trials)
    return packed_tables(design, number, tables, given_up, ticks, perturbed=perturbed)


def packed_tables(
    design: VirtualDesign,
    number: int,
    measured_blocks: Sequence[Measured],
    given_up: int,
    ticks: int,
    *,
    perturbed: bool,
) -> bytes:
    """Return the packed tables of a virtual study from its measured blocks.

    - `given_up`, `ticks`: aborted blocks, and simulated ticks of all blocks [1].
    - `perturbed`: whether its plan has perturbation trials: all studies of a cohort have the same tables.
    """
    study = study_of(measured_blocks, READINGS)
    whole = {
        "study": number,
        "seed": design.seed_of(number),
        "dyads": design.dyads,
        "blocks": len(measured_blocks),
        "given_up": given_up,
        "trials": len(study.counted),
        "attempts": len(study.trials),
        "excluded": study.excluded_attempts,
        "duration": ticks * TICK_SECONDS,
    }
    fields = fields_of(study)
    packed = {"groups": written(group_rows(study, number), fields["groups"])}
    if design.keep_trials:
        packed["trials"] = written(attempt_rows(study, number), fields["trials"])
    if perturbed:
        packed["pushes"] = push_rows(study, number)
    return _packed(whole, packed, fields, study)


@dataclass(frozen=True, slots=True)
class StudyTables:
    """Tables of a virtual study, read back from its file.

    - `whole`: row of the table of studies.
    - `contrasts`, `factors`: declared contrasts and further factors of the study, as in `netboard.analysis.topics`.
    """

    whole: Mapping[str, Any]
    tables: Mapping[str, Columns]
    fields: Mapping[str, tuple[Field, ...]]
    contrasts: list[dict[str, Any]]
    factors: list[dict[str, Any]]


def _packed(whole: Mapping[str, Any], tables: Mapping[str, Columns], fields: Any, study: Tables) -> bytes:
    """Pack tables: a line of JSON that describes them, then an Arrow stream for each."""
    head = {
        "whole": whole,
        "fields": {name: [(one.name, one.kind, one.text, one.unit) for one in fields[name]] for name in tables},
        "contrasts": [asdict(one) for one in questions_of(study)],
        "factors": [asdict(one) for one in study.factors],
    }
    sink, streams = BytesIO(), Streams("zstd")
    sink.write(json.dumps(head).encode() + b"\n")
    for name, columns in tables.items():
        streams.write(sink, columns, fields[name])
    return sink.getvalue()


def unpack(content: bytes | memoryview) -> StudyTables:
    """Read packed tables."""
    line, _, rest = bytes(content).partition(b"\n")
    head, streams = parse_json(line), Streams("zstd")
    fields = {name: tuple(Field(*one) for one in own) for name, own in head["fields"].items()}
    source = streams.source(memoryview(rest))
    tables = {name: streams.read(source, own) for name, own in fields.items()}
    return StudyTables(head["whole"], tables, fields, head["contrasts"], head["factors"])
