"""The plan of one dyad: sessions, blocks and trials, as a pure function of study, seed and number of the dyad.

Equal arguments give an equal plan with an equal `digest`, on any computer and at any time, so an interrupted session
continues with the same plan. The rest of the program sees only the `Config` of one block, which `config_of` derives
from the rig's configuration.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from netboard.base.config import Config, Side, contradictions
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Block, Design, Role
from netboard.base.tables.outcomes import Declaration
from netboard.base.tables.questionnaires import Form, flaws_of_form, packed
from netboard.task.plans.conditions import Conditions, Performer, Sequence
from netboard.task.studies.declaration import declaration_of
from netboard.task.studies.factors import declared, role_by_name
from netboard.task.studies.order import steps_of
from netboard.task.studies.parts import SESSION, Questionnaire
from netboard.task.studies.study import Study

Hand = Literal["right", "left"]

OTHER_SIDE: dict[Side, Side] = {"left": "right", "right": "left"}


@dataclass(frozen=True, slots=True)
class PlanTrial:
    """One planned trial."""

    number: int
    target: Side
    catch: bool


@dataclass(frozen=True, slots=True)
class PlanBlock:
    """One planned block."""

    number: int
    kind: str
    performer: Performer
    other_hand: str
    conditions: tuple[tuple[str, str], ...]
    count: int
    duration: float  # time limit after which no trial begins; 0: none [s]
    first_target: Side
    catch: tuple[int, ...]
    perturbed: tuple[int, ...]  # numbers of the perturbation trials
    opposite: tuple[int, ...]  # those of them whose force has the opposite sign
    rest: float  # before the block [s]
    questionnaires: tuple[tuple[str, str], ...]
    instructions: tuple[dict[str, str], ...]  # parts of the instructions before the block, each by language
    changes: dict[str, dict[str, Any]]
    seed: int
    form: Form  # the participants' questions after it
    design: Design  # role, factors and levels, as in the block's configuration
    analysis: Declaration = field(default_factory=Declaration)  # what the study declares, as in the configuration

    @property
    def role(self) -> Role:
        """Role of the trials, except catch trials."""
        return role_by_name(self.kind) if self.design.role == "auto" else self.design.role

    @property
    def configuration(self) -> Literal["dyadic", "bimanual"]:
        """Whether two participants use one hand each, or one uses both hands."""
        return "bimanual" if self.performer != "dyad" and self.other_hand == "own" else "dyadic"

    @property
    def label(self) -> str:
        """Name of the block for operators and in the data."""
        who = self.kind if self.performer == "dyad" else f"{self.kind} {self.performer}"
        return ", ".join((who, *(f"{factor} {level}" for factor, level in self.conditions)))

    @property
    def trials(self) -> tuple[PlanTrial, ...]:
        """Trials of the block; the target changes side after each."""
        sides = (self.first_target, OTHER_SIDE[self.first_target])
        catch = set(self.catch)
        return tuple(PlanTrial(n, sides[(n - 1) % 2], n in catch) for n in range(1, self.count + 1))


@dataclass(frozen=True, slots=True)
class PlanSession:
    """One planned session: the blocks of one visit."""

    number: int
    blocks: tuple[PlanBlock, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """The plan of one dyad."""

    study: str
    seed: int
    dyad: int
    order: str
    hands: tuple[Hand, Hand]
    seat_a: Side  # proposed seat of participant A; B sits on the other side
    sessions: tuple[PlanSession, ...]

    @property
    def blocks(self) -> tuple[PlanBlock, ...]:
        """The blocks of all sessions."""
        return tuple(block for session in self.sessions for block in session.blocks)


# --- making a plan -----------------------------------------------------------------------------------------------


def plan_of(study: Study, seed: int, dyad: int, hands: tuple[Hand, Hand] = ("right", "right")) -> Plan:
    """Make the plan of a dyad.

    ``hands``: dominant hands of participants A and B; if they differ, they decide the seats (reading C5).
    """
    if seed < 0 or dyad < 1:
        raise ValueError(f"seed {seed}, dyad {dyad}: expected a seed from 0 and a dyad from 1")
    assigned, done = Conditions(study, seed, dyad), Counter[Sequence]()
    sessions = tuple(
        PlanSession(number, tuple(_blocks(study, assigned, steps, done)))
        for number, steps in enumerate(_performed(study, assigned.order), start=1)
    )
    seat_a: Side = assigned.seat if hands[0] == hands[1] else hands[0]
    return Plan(study.name, seed, dyad, assigned.order, hands, seat_a, tuple(_with_targets(assigned, sessions)))


def to_json(plan: Plan) -> str:
    """Return a plan as one line of JSON with sorted keys: equal plans give the same text.

    Of a block's design it holds only what does not follow from the study: a declared role, and the levels drawn for
    trials. The declared analysis follows from the study, and no block depends on it.
    """
    whole = asdict(plan)
    for block in (block for session in whole["sessions"] for block in session["blocks"]):
        design = block.pop("design")
        del block["analysis"]
        if not block["form"]["questions"]:
            del block["form"]  # keeps the digest of plans without questions to participants
        for name in [name for name in ("perturbed", "opposite") if not block[name]]:
            del block[name]  # keeps the digest of plans without perturbations
        block |= {name: design[name] for name in ("role", "trials") if design[name] not in ("auto", {})}
    return json.dumps(whole, sort_keys=True, separators=(",", ":"))


def digest(plan: Plan, blocks: int | None = None, trials: int | None = None) -> str:
    """Return the SHA-256 of a plan, also `shortened`, in hexadecimal; equal plans have equal digests."""
    whole = hashlib.sha256(to_json(plan).encode()).hexdigest()
    if blocks is None and trials is None:
        return whole
    return hashlib.sha256(f"{whole} {blocks} {trials}".encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class _Step:
    """One block of a session: its kind and performer, whether a long rest precedes it, and whether it is the last."""

    sequence: Sequence
    rested: bool
    last: bool


def _performed(study: Study, order: str) -> Iterator[list[_Step]]:
    """Yield the steps of each session of an order."""
    for session in steps_of(study.orders[order]):
        steps = [
            _Step((step.kind, performer), step.rested and first == 0, last=False)
            for step in session
            for first, performer in enumerate(study.kinds[step.kind].people())
        ]
        yield [*steps[:-1], replace(steps[-1], last=True)]


def _blocks(study: Study, assigned: Conditions, steps: list[_Step], done: Counter[Sequence]) -> Iterator[PlanBlock]:
    """Make the blocks of a session; `_with_targets` sets their first targets."""
    for number, step in enumerate(steps, start=1):
        conditions = assigned.at(step.sequence, done[step.sequence])
        yield _block(study, assigned, step, number, conditions, done.total())
        done[step.sequence] += 1


def _block(
    study: Study, assigned: Conditions, step: _Step, number: int, conditions: tuple[tuple[str, str], ...], place: int
) -> PlanBlock:
    """Make one block."""
    name, performer = step.sequence
    kind = study.kinds[name]
    levels = [study.factors[factor].levels[level] for factor, level in conditions]
    changes = _merged([part.changed() for part in (study, kind, *levels)])
    block = replace(Block(), **changes.get("block", {}))
    within = assigned.within(name, block.trials, place) if block.haptics else {}
    if scales := _scales(study, within, block.force_scale):
        changes = {**changes, "block": {**changes.get("block", {}), "trial_scales": scales}}
    catch = assigned.catch(name, block.trials, place) if block.haptics else ()
    there = changes.get("perturbation", {}).get("at", "none") != "none"
    perturbed, opposite = assigned.perturbed(name, block.trials, catch, place) if there else ((), ())
    ended = {name, SESSION} if step.last else {name}
    asked = {q: one for q, one in study.questionnaires.items() if ended & {*one.after}}
    base = {**study.instructions, **kind.instructions}
    return PlanBlock(
        number=number,
        kind=name,
        performer=performer,
        other_hand=next((level.other_hand for level in levels if level.other_hand), kind.other_hand),
        conditions=conditions,
        count=block.trials,
        duration=block.duration,
        first_target="left",
        catch=catch,
        perturbed=perturbed,
        opposite=opposite,
        rest=0.0 if number == 1 else study.long_rest if step.rested else block.rest,
        questionnaires=tuple((q, one.text) for q, one in asked.items() if one.text),
        instructions=tuple(part for part in (base, *(level.instructions for level in levels)) if part),
        changes=changes,
        seed=assigned.seed_at(place),
        form=_form(name, asked),
        design=_design(study, name, conditions, within),
        analysis=declaration_of(study),
    )


def _form(kind: str, asked: Mapping[str, Questionnaire]) -> Form:
    """Make the form of a block of the questionnaires that follow it."""
    questions = [(q, name, question) for q, one in asked.items() for name, question in one.asked().items()]
    if problem := next(flaws_of_form({f"{q}.{name}": question for q, name, question in questions}), ""):
        raise ConfigError(f"[kinds.{kind}]: {problem}")
    waits = [one.wait for one in asked.values() if one.asked()]
    return Form(tuple(packed(*question) for question in questions), max(waits, default=Form().wait))


def _design(
    study: Study, kind: str, conditions: tuple[tuple[str, str], ...], trials: dict[str, tuple[str, ...]]
) -> Design:
    """Make the design of a block: its factors with their levels."""
    factors = {name: declared(study.factors[name]) for name in (*dict(conditions), *trials)}
    return Design(
        kind=kind,
        role=study.kinds[kind].role,
        between=tuple(name for name in factors if study.factors[name].order == "between"),
        factors=dict(conditions),
        trials=trials,
        levels={name: one.levels for name, one in factors.items()},
        types={name: one.type for name, one in factors.items()},
        values={name: one.values for name, one in factors.items() if one.values},
        units={name: one.unit for name, one in factors.items() if one.unit},
    )


def _scales(study: Study, within: dict[str, tuple[str, ...]], otherwise: float) -> tuple[float, ...]:
    """Return the force scale of each trial; empty if no trial differs from the block."""
    of_levels = {
        name: {level: changes.block.get("force_scale") for level, changes in study.factors[name].levels.items()}
        for name in within
    }
    each = zip(*([of_levels[name][level] for level in levels] for name, levels in within.items()), strict=True)
    scales = tuple(next((float(one) for one in trial if one is not None), otherwise) for trial in each)
    return scales if any(one != otherwise for one in scales) else ()


def _merged(parts: list[dict[str, dict[str, Any]]]) -> dict[str, dict[str, Any]]:
    """Merge changes; later ones override earlier ones."""
    whole: dict[str, dict[str, Any]] = {}
    for part in parts:
        for table, keys in part.items():
            whole[table] = {**whole.get(table, {}), **keys}
    return whole


def _with_targets(assigned: Conditions, sessions: tuple[PlanSession, ...]) -> Iterator[PlanSession]:
    """Set the first target of each block, balanced over the blocks of a sequence and condition (C7)."""
    blocks = [block for session in sessions for block in session.blocks]
    alike = Counter(((block.kind, block.performer), block.conditions) for block in blocks)
    drawn = {cell: iter(assigned.first_targets(*cell, number)) for cell, number in alike.items()}
    for session in sessions:
        given = []
        for block in session.blocks:
            side = next(drawn[(block.kind, block.performer), block.conditions])
            wanted = block.changes.get("block", {}).get("first_target", "random")
            given.append(replace(block, first_target=side if wanted == "random" else wanted))
        yield replace(session, blocks=tuple(given))


# --- one block's configuration -----------------------------------------------------------------------------------


def seated(config: Config, plan: Plan) -> Config:
    """Return the rig's configuration with the study's name and the proposed seats in ``[session]``."""
    return replace(config, session=replace(config.session, study=plan.study, seat_a=plan.seat_a))


def config_of(config: Config, session: PlanSession, number: int) -> Config:
    """Make the configuration of one block.

    ``config``: configuration of the rig: the seats (``session.seat_a``) and all keys that the study does not set; its
    ``[block]`` is ignored.
    """
    plan = session.blocks[number - 1]
    tables = {
        table: replace(getattr(config, table), **keys) for table, keys in plan.changes.items() if table != "block"
    }
    config = replace(config, **tables)
    config = replace(
        config,
        block=_block_of(config, session, plan),
        perturbation=replace(config.perturbation, trials=plan.perturbed, opposite=plan.opposite),
        form=plan.form,
        design=plan.design,
        analysis=plan.analysis,
    )
    problems = "\n".join(f"block {number} ({plan.label}): {problem}" for problem in contradictions(config))
    if problems:
        raise ConfigError(problems)
    return config


def configs_of(config: Config, plan: Plan) -> Iterator[Config]:
    """Make the configuration of each block of a plan on a rig; see `config_of`."""
    rig = seated(config, plan)
    for session in plan.sessions:
        for block in session.blocks:
            yield config_of(rig, session, block.number)


def _block_of(config: Config, session: PlanSession, plan: PlanBlock) -> Block:
    """Make the table ``[block]`` of a planned block."""
    block = replace(Block(), **plan.changes.get("block", {}))
    if plan.performer != "dyad":
        seat = config.session.seat_a if plan.performer == "A" else OTHER_SIDE[config.session.seat_a]
        block = replace(block, performer=plan.performer, station=seat)
        if plan.other_hand != "own":
            block = replace(block, right=plan.other_hand) if seat == "left" else replace(block, left=plan.other_hand)
    return replace(
        block,
        number=plan.number,
        blocks=len(session.blocks),
        label=plan.label,
        configuration=plan.configuration,
        catch=plan.catch,
        first_target=plan.first_target,
        rest=plan.rest,
        questionnaires="; ".join(f"{name}: {text}" for name, text in plan.questionnaires),
        instructions="\n\n".join(_in_language(part, config.display.language) for part in plan.instructions),
        seed=plan.seed,
    )


def _in_language(texts: dict[str, str], language: str) -> str:
    """Return a text in the display's language, else in English, else in the first language."""
    return texts.get(language) or texts.get("en") or next(iter(texts.values()))


def blocks_of(config: Config, study: Study, seed: int, dyad: int) -> list[Config]:
    """Return the configuration of each block of a dyad, in order, with the names of session and dyad."""
    plan = plan_of(study, seed, dyad, (config.session.hand_a, config.session.hand_b))
    rig = seated(config, plan)
    return [
        config_of(
            replace(rig, session=replace(rig.session, name=f"S{session.number:02d}", dyad=f"D{dyad:02d}")),
            session,
            block.number,
        )
        for session in plan.sessions
        for block in session.blocks
    ]


def shortened(blocks: list[Config], most: int | None, trials: int | None) -> Iterator[Config]:
    """Yield only the first blocks, with fewer trials each.

    ``most``: number of blocks to keep; None for all. ``trials``: most trials per block; None for no limit.
    """
    kept = blocks[:most]
    for config in kept:
        count = config.block.trials if trials is None else min(trials, config.block.trials)
        table = config.perturbation
        catch, perturbed, opposite = (
            tuple(trial for trial in every if trial <= count)
            for every in (config.block.catch, table.trials, table.opposite)
        )
        yield replace(
            config,
            block=replace(config.block, blocks=len(kept), trials=count, catch=catch),
            perturbation=replace(table, trials=perturbed, opposite=opposite),
        )
