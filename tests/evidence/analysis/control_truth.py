"""``make evidence ARGS=controls``: parts of the effects of haptic feedback on simulated dyads, whose truth is known.

The force tells dyads nothing (``partner_model = "mechanics"``), or where the partner's hand is. The same dyads, with
the same random numbers, do both. So the true communicative part of the former is 0, except for what their eyes correct.
The arms of simulated participants have the usual stiffness; in two cases the friction that acts is known, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import study_of
from netboard.analysis.topics.controls import ControlledEffect, controls
from netboard.analysis.topics.units import Unit, read_in
from netboard.base.config import Config
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.nodes.rehearsal.jobs import RehearsalJob, rehearse
from netboard.participants.people.population import LETTERS, person_of
from netboard.recording.export.runs import runs_of

SEED = 11
"""Seed of the participants and of their blocks [1]."""

DYADS, QUICK_DYADS = 8, 3
"""Number of dyads [1]."""

TRIALS, QUICK_TRIALS = 40, 8
"""Successful trials in a block [1]."""

PRACTICE = 300.0
"""Trials that each participant has practised [1]."""


@dataclass(frozen=True)
class Case:
    """Simulated dyads: their participants, and the friction of their devices [N].

    `known`: whether their arms are the usual one with the device; otherwise they compensate a part of its friction.
    """

    name: str
    participant: Participant = field(default_factory=Participant)
    friction: float = 0.26
    known: bool = False

    @property
    def told(self) -> bool:
        """Whether the force tells something."""
        return self.participant.partner_model != "mechanics"


_DEAF = Participant(partner_model="mechanics")
_BARE = replace(_DEAF, friction_skill=0.0, load_skill=0.0)

CASES = (
    Case("mechanics", _DEAF),
    Case("mechanics, friction not compensated", _BARE, known=True),
    Case("mechanics, device of little friction", _BARE, friction=0.05, known=True),
    Case("position", Participant(partner_model="position")),
)
"""All cases; the first and the last differ in nothing but what the force tells."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Rehearse, record and analyse the dyads of each case."""
    dyads, trials = (QUICK_DYADS, QUICK_TRIALS) if quick else (DYADS, TRIALS)
    found: dict[str, tuple[ControlledEffect, ...]] = {}
    for number, case in enumerate(CASES):
        tell(case.name, number / len(CASES))
        found[case.name] = effects(case, dyads, trials)
    yield parts(found, dyads, trials)


def effects(case: Case, dyads: int, trials: int) -> tuple[ControlledEffect, ...]:
    """Return the effects of haptic feedback on dyads with their controls, from recordings, as an analysis does."""
    with TemporaryDirectory() as where:
        for dyad in range(1, dyads + 1):
            for force in ("none", "full"):
                rehearse(job(case, dyad, force, trials, Path(where)))
        measured = [measure(run, Readings()) for run in runs_of(sorted(Path(where).glob("*.mcap")))]
        found = controls(study_of(measured, Readings())).parts
    return tuple(one for one in found if not one.why)


def job(case: Case, dyad: int, force: str, trials: int, folder: Path) -> RehearsalJob:
    """Return a block of a dyad."""
    base = Config()
    person = replace(case.participant, practice=PRACTICE)
    number = 1 if force == "none" else 2
    config = replace(
        base,
        participant=person,
        virtual=replace(base.virtual, friction=case.friction),
        session=replace(base.session, dyad=f"D{dyad:02}", pilot=True),
        block=replace(base.block, number=number, blocks=2, force=force, trials=trials, seed=dyad),
    )
    people = {letter: person_of(person, SEED, dyad, letter) for letter in LETTERS}
    return RehearsalJob(config, people, f"{dyad:030x}{number:02x}", folder)


def parts(found: dict[str, tuple[ControlledEffect, ...]], dyads: int, trials: int) -> ResultPart:
    """Tabulate each effect with its parts, and compare them with the truth."""
    part = ResultPart(
        "parts",
        f"Effects of haptic feedback on {dyads} dyads, {trials} trials in a block, and their parts (95 % intervals)",
        "what the force tells | measure | unit | effect | passive part, with the device | no friction "
        "| communicative part, with the device | no friction | all arms | contains no effect",
    )
    for case in CASES:
        for one in found[case.name]:
            part.add(case.name, *_row(one))
    deaf = [case for case in CASES if not case.told]
    lost = [f"{case.name}: {one.measure.name}" for case in deaf for one in found[case.name] if one.remains]
    tested = sum(len(found[case.name]) for case in deaf)
    part.claim(
        "if the force tells nothing, the interval of the communicative part with all arms contains no effect",
        not lost,
        ", ".join(lost) or f"{tested} of {tested} intervals",
    )
    known = [one.usual[0].rest for case in deaf if case.known for one in found[case.name]]
    hits = sum(rest.low <= 0.0 <= rest.high for rest in known)
    part.claim(
        "where the arm is known, at least four of five intervals with this arm contain no effect",
        hits >= 0.8 * len(known),
        f"{hits} of {len(known)}",
    )
    same = [
        one.predicted == other.predicted
        for first, last in zip(found[CASES[0].name], found[CASES[-1].name], strict=True)
        for one, other in zip(first.passive, last.passive, strict=True)
    ]
    part.claim(
        "the passive part does not depend on what the force tells", all(same), f"{sum(same)} of {len(same)} equal"
    )
    return part


def _row(one: ControlledEffect) -> tuple[str, ...]:
    """Return the cells of an effect, in the display unit of its measure."""
    unit = read_in(one.unit, f"{one.measure.name}: difference", one.group)
    whole = one.over_arms("rest")
    assert whole is not None  # for the type checker; an effect without controls is left out
    device, bare = one.usual
    means = (one.effect, device.predicted, bare.predicted, device.rest, bare.rest)
    cells = (f"{unit.scale * mean.value:.3g} ({_between(mean.low, mean.high, unit)})" for mean in means)
    said = "no" if one.remains else "yes"
    return one.measure.name, unit.symbol, *cells, _between(whole.low, whole.high, unit), said


def _between(low: float, high: float, unit: Unit) -> str:
    return f"{unit.scale * low:.3g} to {unit.scale * high:.3g}"
