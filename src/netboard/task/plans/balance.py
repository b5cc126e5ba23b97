"""Balance checks of a study's plans: trials per participant and condition, and counterbalancing over dyads.

Within each dyad, every participant must have the same number of trials in all conditions of a kind of block, and as
many as the study promises; otherwise the study is refused. Properties that can only be balanced over several dyads are
counted, and reported if they are uneven.

The checks are independent of the code that makes plans: they count what a plan contains.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from netboard.base.errors import ConfigError
from netboard.base.plural import plural
from netboard.task.plans.conditions import sequences_of
from netboard.task.plans.plan import Plan, PlanBlock
from netboard.task.studies.study import Study

PARTICIPANTS = ("A", "B")
Cell = tuple[str, tuple[str, ...]]
"""A kind of block, and the level of each of its factors."""


@dataclass(frozen=True, slots=True)
class PrintedTable:
    """A table to be shown to the user."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Balance:
    """Result of the balance checks: problems refuse the study; properties that are uneven over the dyads do not."""

    tables: tuple[PrintedTable, ...]
    problems: tuple[str, ...]
    uneven: tuple[str, ...]


def balance_of(study: Study, plans: Sequence[Plan]) -> Balance:
    """Count the plans of a study."""
    counts = tuple(_counts(study, plans)) if len(plans) > 1 else ()
    uneven = tuple(f"{what}: {_listed(count)}" for what, count in counts if not _even(count))
    over = [(what, _listed(count), "even" if _even(count) else "uneven") for what, count in counts]
    tables = (
        _trials_table(study, plans),
        _starts_table(study, plans),
        *([PrintedTable(f"Over {plural(len(plans), 'dyad')}", ("what", "how often", ""), tuple(over))] if over else []),
        _practice_table(study, plans),
    )
    return Balance(tables, tuple(_problems(study, plans)), uneven)


def require_balance(study: Study, plan: Plan) -> Plan:
    """Return a plan if it is balanced; else raise ConfigError."""
    problems = list(_problems(study, [plan]))
    if problems:
        raise ConfigError("\n".join(f"study {study.name}: {problem}" for problem in problems))
    return plan


# --- counting ----------------------------------------------------------------------------------------------------


def _cells(study: Study, kind: str, plan: Plan) -> tuple[Cell, ...]:
    """List the conditions of a kind that a dyad should have; of a between-dyads factor, only the dyad's own level."""
    planned = {factor: level for block in plan.blocks for factor, level in block.conditions}
    levels = [
        [planned[name]] if factor.order == "between" and name in planned else list(factor.levels)
        for name, factor in study.factors_of(kind).items()
    ]
    return tuple((kind, cell) for cell in product(*levels))


def _cell(block: PlanBlock) -> Cell:
    """Return kind and levels of a block."""
    return block.kind, tuple(level for _, level in block.conditions)


def _blocks_of(plan: Plan, participant: str) -> list[PlanBlock]:
    """List the blocks in which a participant takes part."""
    return [block for block in plan.blocks if block.performer in ("dyad", participant)]


def _problems(study: Study, plans: Sequence[Plan]) -> Iterator[str]:
    """Find unbalanced counts."""
    for plan, participant in product(plans, PARTICIPANTS):
        blocks = _blocks_of(plan, participant)
        for kind in study.kinds:
            of_kind = [block for block in blocks if block.kind == kind]
            if of_kind and study.factors_of(kind):
                where = f"dyad {plan.dyad}, participant {participant}, {kind}"
                yield from (f"{where}: {problem}" for problem in _kind_problems(study, plan, kind, of_kind))


def _kind_problems(study: Study, plan: Plan, kind: str, blocks: list[PlanBlock]) -> Iterator[str]:
    """Find unbalanced counts in one participant's blocks of a kind."""
    cells = _cells(study, kind, plan)
    trials = {cell: sum(block.count for block in blocks if _cell(block) == cell) for cell in cells}
    times = {cell: sum(block.duration for block in blocks if _cell(block) == cell) for cell in cells}
    number = Counter(_cell(block) for block in blocks)
    found = ", ".join(f"{_levels_text(cell)} {trials[cell]} in {plural(number[cell], 'block')}" for cell in cells)
    promised = study.trials_per_condition
    if len(set(trials.values())) > 1 or len({number[cell] for cell in cells}) > 1 or len(set(times.values())) > 1:
        yield f"trials are not even: {found}; expected as many in every condition (blocks in multiples of {len(cells)})"
    elif promised and set(trials.values()) != {promised}:
        yield f"trials are {found}; expected {promised} in every condition (trials_per_condition)"


def _counts(study: Study, plans: Sequence[Plan]) -> Iterator[tuple[str, Counter[str]]]:
    """Count what should be balanced over dyads, except properties that do not vary."""
    if len(study.taken()) > 1:
        yield "order", _counted(study.taken(), [plan.order for plan in plans])
    yield "seat of A", _counted(("left", "right"), [plan.seat_a for plan in plans])
    for name, factor in study.factors.items():
        if factor.order == "between":
            found = [dict(block.conditions)[name] for plan in plans for block in _varying(plan, name)[:1]]
            yield name, _counted(tuple(factor.levels), found)
            continue
        for kind, performer in sequences_of(study, name):
            firsts = [_blocks_in(plan, kind, performer)[:1] for plan in plans]
            found = [dict(block.conditions)[name] for first in firsts for block in first]
            if found:
                yield f"{_sequence(kind, performer)} begins with {name}", _counted(tuple(factor.levels), found)
    sides: dict[str, list[str]] = {}
    for block in (block for plan in plans for block in plan.blocks):
        what = f"first target of {_sequence(block.kind, block.performer)} {_levels_text(_cell(block))}".rstrip()
        sides.setdefault(what, []).append(block.first_target)
    for what in sorted(sides):
        yield what, _counted(("left", "right"), sides[what])


def _counted(values: Sequence[str], found: Sequence[str]) -> Counter[str]:
    """Count how often each value was found; values that were not found count 0."""
    return Counter({value: sum(one == value for one in found) for value in values})


def _varying(plan: Plan, factor: str) -> list[PlanBlock]:
    """List the blocks that have a level of a factor."""
    return [block for block in plan.blocks if factor in dict(block.conditions)]


def _blocks_in(plan: Plan, kind: str, performer: str) -> list[PlanBlock]:
    """List the blocks of a sequence, in order."""
    return [block for block in plan.blocks if (block.kind, block.performer) == (kind, performer)]


# --- tables ------------------------------------------------------------------------------------------------------


def _trials_table(study: Study, plans: Sequence[Plan]) -> PrintedTable:
    """Return the table of trials per participant, kind and condition."""
    cells = [cell for kind in study.kinds for cell in _all_cells(study, kind)]
    rows = []
    for plan, participant in product(plans, PARTICIPANTS):
        blocks = _blocks_of(plan, participant)
        rows.append(
            (f"{plan.dyad} {participant}", *(_amount([b for b in blocks if _cell(b) == cell]) for cell in cells))
        )
    return PrintedTable(
        "Trials of each participant",
        ("dyad", *(f"{cell[0]} {_levels_text(cell)}".strip() for cell in cells)),
        tuple(rows),
    )


def _amount(blocks: list[PlanBlock]) -> str:
    """Return the number of trials, or the duration of blocks with a time limit."""
    time = sum(block.duration for block in blocks)
    return f"{time:g} s" if time else str(sum(block.count for block in blocks))


def _starts_table(study: Study, plans: Sequence[Plan]) -> PrintedTable:
    """Return the table of the first condition of each dyad and sequence."""
    sequences = [one for one in sequences_of(study) if study.factors_of(one[0])]
    rows = []
    for plan in plans:
        firsts = [_blocks_in(plan, *one)[:1] for one in sequences]
        cells = (_levels_text(_cell(first[0])) if first else "" for first in firsts)
        rows.append((str(plan.dyad), plan.order, plan.seat_a, *cells))
    columns = ("dyad", "order", "seat of A", *(_sequence(*one) for one in sequences))
    return PrintedTable("What each dyad begins with", columns, tuple(rows))


def _practice_table(study: Study, plans: Sequence[Plan]) -> PrintedTable:
    """Return the table of mean practice: blocks done before a block of each kind and condition."""
    before: dict[Cell, list[int]] = {}
    for plan, participant in product(plans, PARTICIPANTS):
        for done, block in enumerate(_blocks_of(plan, participant)):
            before.setdefault(_cell(block), []).append(done)
    rows = [
        (f"{cell[0]} {_levels_text(cell)}".strip(), f"{sum(before[cell]) / len(before[cell]):.2f}")
        for kind in study.kinds
        for cell in _all_cells(study, kind)
        if cell in before
    ]
    return PrintedTable(
        "Practice: blocks a participant has done before, on average", ("kind, condition", "blocks"), tuple(rows)
    )


def _all_cells(study: Study, kind: str) -> tuple[Cell, ...]:
    """All conditions of a kind."""
    return tuple((kind, cell) for cell in product(*(factor.levels for factor in study.factors_of(kind).values())))


def _levels_text(cell: Cell) -> str:
    """Format the levels of a condition."""
    return " ".join(cell[1])


def _sequence(kind: str, performer: str) -> str:
    """Return the name of a sequence."""
    return kind if performer == "dyad" else f"{kind} {performer}"


def _even(count: Counter[str]) -> bool:
    """Return whether all values occur equally often."""
    return len(set(count.values())) == 1


def _listed(count: Counter[str]) -> str:
    """Format counts in one line."""
    return ", ".join(f"{value} {number}" for value, number in count.items())
