"""A plan in words and tables: its blocks, the levels of its factors, its balance, and what contradicts the rig."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from rich.console import RenderableType
from rich.text import Text

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.plural import plural
from netboard.base.settings import tables
from netboard.base.tables.outcomes import Declaration
from netboard.base.tables.questionnaires import questions_of
from netboard.base.terminal.output import FittedTable
from netboard.task.plans.balance import Balance, PrintedTable, balance_of
from netboard.task.plans.plan import Plan, PlanBlock, PlanSession, config_of, digest, seated, to_json
from netboard.task.studies.declaration import declaration_of
from netboard.task.studies.factors import declared, level_text
from netboard.task.studies.study import Study

WHERE = {"between": "between dyads", "trial": "within blocks"}
"""Where a factor varies, by its order, if not between blocks."""

MAX_PROBLEMS = 6
"""Number of problems that are shown [1]."""


def plan_in_words(study: Study, plan: Plan, balance: Balance, *, blocks: bool) -> Iterator[RenderableType]:
    """Describe the plan of a dyad, with the levels of its factors and its blocks if wanted, and the balance."""
    if blocks:
        yield Text.assemble((study.name, "bold"), f": {study.text}")
        yield f"dyad {plan.dyad}, seed {plan.seed}, order {plan.order}, A sits {plan.seat_a}, {digest(plan)[:12]}"
        yield analysis_in_words(declaration_of(study))
        if study.factors:
            yield levels_table(study)
        yield from (blocks_table(study, session) for session in plan.sessions)
    yield from map(fitted, balance.tables)


def plan_as_json(plan: Plan, balance: Balance, problems: Sequence[str]) -> str:
    """Return a plan with its balance and its problems as one line of JSON."""
    more = {"digest": digest(plan), "balance": asdict(balance), "problems": problems}
    return json.dumps({**json.loads(to_json(plan)), **more})


def fitted(table: PrintedTable) -> FittedTable:
    """Return a table of the balance for the terminal."""
    return FittedTable(*table.columns, rows=table.rows, title=table.title)


def studies_table(studies: Sequence[Study]) -> FittedTable:
    """Return a table of studies, and the orders of blocks that each can have."""
    rows = [(study.name, study.text, ", ".join(study.orders)) for study in studies]
    return FittedTable("study", "description", "orders", rows=rows)


def blocks_table(study: Study, session: PlanSession) -> FittedTable:
    """Return a table of the blocks of a session, without columns that are empty."""
    drawn = ("trials", "first target", "catch", "perturbed", "rest", "asked")
    names = ("block", "kind", "role", "by", *study.factors, *drawn)
    rows = [tuple(_cells(study, block)) for block in session.blocks]
    used = [place for place, name in enumerate(names) if name in study.factors or any(row[place] for row in rows)]
    columns = (names[place] for place in used)
    return FittedTable(
        *columns, rows=([row[place] for place in used] for row in rows), title=f"Session {session.number}"
    )


def levels_table(study: Study) -> FittedTable:
    """Return what each level of a factor changes, with units."""
    keys = [(*table.path, key.name, key.unit) for table in tables(Config) for key in table.keys]
    units = {tuple(name): f" {unit}" * (unit != "1") for *name, unit in keys}
    rows = []
    for name, factor in study.factors.items():
        for level, changes in factor.levels.items():
            differs = [
                f"{table}.{key} = {value}{units[table, key]}".rstrip()
                for table, changed in changes.changed().items()
                for key, value in changed.items()
            ]
            differs += [f"other_hand = {changes.other_hand}"] if changes.other_hand else []
            rows.append((name, level, ", ".join(differs) or "nothing"))
    return FittedTable("factor", "level", "what differs", rows=rows, title="Factors")


def _cells(study: Study, block: PlanBlock) -> Iterator[str]:
    """Yield the cells of a block's row."""
    levels = dict(block.conditions)
    alone = "" if block.other_hand == "own" else f" ({block.other_hand})"
    role = "" if block.role in ("test", block.kind) else block.role
    yield from (str(block.number), block.kind, role, block.performer + alone)
    yield from (levels.get(factor, "") or _within(block, factor) for factor in study.factors)
    yield f"{block.duration:g} s" if block.duration else str(block.count)
    yield block.first_target
    yield " ".join(map(str, block.catch))
    yield " ".join(f"-{trial}" if trial in block.opposite else str(trial) for trial in block.perturbed)
    yield f"{block.rest:g} s" if block.rest else ""
    asked = [name.partition(".")[0] for name in questions_of(block.form)]
    yield ", ".join(dict.fromkeys([*(name for name, _ in block.questionnaires), *asked]))


def _within(block: PlanBlock, factor: str) -> str:
    """Return how many trials have which level of a factor that varies within a block."""
    found = Counter(block.design.trials.get(factor, ()))
    return ", ".join(f"{count} {level}" for level, count in sorted(found.items()))


def valid_in_words(name: str, study: Study, plans: Sequence[Plan], balance: Balance) -> Iterator[str]:
    """Describe a valid study: its size, its factors, and what is uneven over these dyads."""
    sessions = len(plans[0].sessions)
    size = f"{plural(sessions, 'session')}, {', '.join(_by_role(plans[0].blocks))}"
    yield f"{name}: valid ({size}; equal trial counts in dyads 1 to {len(plans)})"
    for label, factor in study.factors.items():
        found = declared(factor)
        levels = ", ".join(level_text(found, level) for level in found.levels)
        yield f"  factor {label}: {levels}; {found.type}, {WHERE.get(factor.order, 'between blocks')}"
    yield f"  {analysis_in_words(declaration_of(study))}"
    yield from (f"  uneven over {plural(len(plans), 'dyad')}: {uneven}" for uneven in balance.uneven)


def analysis_in_words(found: Declaration) -> str:
    """Describe a declared analysis in a line, or say that there is none."""
    if not found.primary:
        return "analysis: no primary outcome is declared ([analysis]), so the report will be exploratory"
    secondary = f"; secondary: {', '.join(found.secondary)}" if found.secondary else ""
    return f"analysis: {found.primary}, {found.contrast}, method {found.method}{secondary}"


def _by_role(blocks: Sequence[PlanBlock]) -> Iterator[str]:
    """Count blocks and trials of each role, tests first."""
    for role in sorted({block.role for block in blocks}, key=lambda role: (role != "test", role)):
        found = [block for block in blocks if block.role == role]
        trials = sum(block.count for block in found)
        size = plural(len(found), "block" if role == "test" else f"{role} block")
        yield f"{size}, {plural(trials, 'trial')}" if role == "test" else f"{size} with {plural(trials, 'trial')}"


def examine(
    config: Config, study: Study, plans: Sequence[Plan], more: Sequence[Plan] = ()
) -> tuple[Balance, list[str]]:
    """Return the balance of plans, and their problems; of `more` plans, only whether they fit the rig."""
    balance = balance_of(study, plans)
    return balance, [*balance.problems, *misfits(config, [*plans, *more])]


def misfits(config: Config, plans: Sequence[Plan]) -> list[str]:
    """Find blocks that contradict the rig's configuration; the same problem of several blocks is reported once."""
    found: dict[str, str] = {}
    for plan in plans:
        rig = seated(config, plan)
        for session in plan.sessions:
            for block in session.blocks:
                try:
                    config_of(rig, session, block.number)
                except ConfigError as error:
                    for line in str(error).splitlines():
                        found.setdefault(line.partition("): ")[2], f"dyad {plan.dyad}, {line}")
    return list(found.values())


def refuse(problems: Sequence[str]) -> None:
    """Raise ConfigError with the first problems of a study, if there are any."""
    if problems:
        more = [f"and {len(problems) - MAX_PROBLEMS} more like these"] if len(problems) > MAX_PROBLEMS else []
        raise ConfigError("\n".join(["the study is not valid", *problems[:MAX_PROBLEMS], *more]))
