"""Finds a study by name or file, and shows its plans."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from rich.console import Console

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.settings import tables
from netboard.base.terminal import FittedTable
from netboard.task.plans.balance import Balance, balance_of
from netboard.task.plans.balance import Table as Counts
from netboard.task.plans.plan import Plan, PlanBlock, config_of, digest, plan_of, seated, to_json
from netboard.task.studies import library
from netboard.task.studies.factors import declared, level_text
from netboard.task.studies.study import Study, parse_study, resolve_study

OK = 0

MOST = 6
"""Number of problems that are shown."""


def load(word: str) -> Study:
    """Read a study.

    Parameters
    ----------
    word : str
        A built-in study's name or a file; ``:ORDER`` after it takes another of its orders, ``:ONE,OTHER`` several that
        dyads take in turn.
    """
    name, colon, orders = (word, "", "") if Path(word).is_file() else word.partition(":")
    study = parse_study(_text_of(name), name)
    if not colon:
        return study
    return parse_study(resolve_study(replace(study, order=tuple(orders.split(",")))), word)


def _text_of(name: str) -> str:
    """Read the text of a built-in study or of a file."""
    if name in library.NAMES:
        return library.text_of(name)
    try:
        return Path(name).read_text(encoding="utf-8")
    except FileNotFoundError:
        known = ", ".join(library.NAMES)
        raise ConfigError(f"{name}: no such study or file; the built-in studies are {known}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name}: cannot be read: {error}") from error


def show(config: Config, study: Study, seed: int, dyad: int | None, dyads: int | None, *, as_json: bool) -> int:
    """Show the plan of one dyad, or of several with their counterbalancing.

    Parameters
    ----------
    config : Config
        The rig, which knows the participants' hands and what the study leaves open.
    dyad : int or None
        The dyad whose blocks are shown; None: the first, or none of them if `dyads` are counted.
    """
    console = Console()
    hands = config.session.hand_a, config.session.hand_b
    shown = plan_of(study, seed, dyad or 1, hands)
    plans = [plan_of(study, seed, number) for number in range(1, dyads + 1)] if dyads else [shown]
    balance = balance_of(study, plans)
    problems = [*balance.problems, *_misfits(config, [*plans, shown])]
    if as_json:
        whole = {
            **json.loads(to_json(shown)),
            "digest": digest(shown),
            "balance": asdict(balance),
            "problems": problems,
        }
        console.file.write(json.dumps(whole) + "\n")
    else:
        if dyad or not dyads:
            _print_plan(console, study, shown)
        _print_balance(console, balance)
    return _verdict(problems)


def check(config: Config, study: Study, word: str, seed: int, dyads: int) -> int:
    """Check that a study's plans have equal and expected trial counts in all conditions.

    Parameters
    ----------
    config : Config
        The rig, with which every block must make a valid configuration.
    """
    plans = [plan_of(study, seed, number) for number in range(1, dyads + 1)]
    balance = balance_of(study, plans)
    problems = [*balance.problems, *_misfits(config, plans)]
    console = Console(soft_wrap=True, highlight=False)
    if problems:
        _print_table(console, balance.tables[0])
    else:
        blocks, sessions = plans[0].blocks, len(plans[0].sessions)
        size = f"{sessions} session{'s' * (sessions > 1)}, {', '.join(_by_role(blocks))}"
        console.print(f"{word}: in order ({size}; counts meet for dyads 1 to {dyads})")
        for name, factor in study.factors.items():
            found = declared(factor)
            levels = ", ".join(level_text(found, level) for level in found.levels)
            console.print(f"  factor {name}: {levels}; {found.type}, {WHERE.get(factor.order, 'between blocks')}")
        for uneven in balance.uneven:
            console.print(f"  not even over {dyads} dyads: {uneven}")
    return _verdict(problems)


WHERE = {"between": "between dyads", "trial": "within blocks"}
"""Where a factor varies, by its order, if not between blocks."""


def _by_role(blocks: Sequence[PlanBlock]) -> Iterator[str]:
    """Count blocks and trials of each role, tests first."""
    for role in sorted({block.role for block in blocks}, key=lambda role: (role != "test", role)):
        own = [block for block in blocks if block.role == role]
        trials = sum(block.count for block in own)
        many = f"{len(own)} {'' if role == 'test' else f'{role} '}block{'s' * (len(own) > 1)}"
        yield f"{many}, {trials} trials" if role == "test" else f"{many} with {trials} trials"


def show_list() -> int:
    """List the built-in studies."""
    table = FittedTable("study", "what it is", "orders")
    for name in library.NAMES:
        study = load(name)
        table.add_row(name, study.text, ", ".join(study.orders))
    Console().print(table)
    return OK


def _misfits(config: Config, plans: list[Plan]) -> list[str]:
    """Find blocks that contradict the rig's configuration; the same problem of several blocks is reported once."""
    found: dict[str, str] = {}
    for plan in plans:
        entered = seated(config, plan)
        for session in plan.sessions:
            for block in session.blocks:
                try:
                    config_of(entered, session, block.number)
                except ConfigError as error:
                    for line in str(error).splitlines():
                        found.setdefault(line.partition("): ")[2], f"dyad {plan.dyad}, {line}")
    return list(found.values())


def _verdict(problems: list[str]) -> int:
    """Refuse a study with problems."""
    if problems:
        more = [f"and {len(problems) - MOST} more like these"] if len(problems) > MOST else []
        raise ConfigError("\n".join(["the study is refused", *problems[:MOST], *more]))
    return OK


def _print_plan(console: Console, study: Study, plan: Plan) -> None:
    """Print the blocks of a dyad."""
    console.print(f"[bold]{study.name}[/bold]: {study.text}", highlight=False)
    console.print(f"dyad {plan.dyad}, seed {plan.seed}, order {plan.order}, A sits {plan.seat_a}, {digest(plan)[:12]}")
    if study.factors:
        _print_table(console, _levels(study))
    names = ("block", "kind", "role", "by", *study.factors, "trials", "first target", "catch", "rest", "asked")
    for session in plan.sessions:
        rows = [tuple(_cells(study, block)) for block in session.blocks]
        used = [place for place, name in enumerate(names) if name in study.factors or any(row[place] for row in rows)]
        title = f"Session {session.number}"
        columns = tuple(names[place] for place in used)
        _print_table(console, Counts(title, columns, tuple(tuple(row[place] for place in used) for row in rows)))


def _levels(study: Study) -> Counts:
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
            rows.append((name, level, ", ".join(differs) or "nothing"))
    return Counts("Factors", ("factor", "level", "what differs"), tuple(rows))


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
    yield f"{block.rest:g} s" if block.rest else ""
    yield ", ".join(name for name, _ in block.questionnaires)


def _within(block: PlanBlock, factor: str) -> str:
    """Return how many trials have which level of a factor that varies within a block."""
    found = Counter(block.design.trials.get(factor, ()))
    return ", ".join(f"{count} {level}" for level, count in sorted(found.items()))


def _print_balance(console: Console, balance: Balance) -> None:
    """Print the balance."""
    for part in balance.tables:
        _print_table(console, part)


def _print_table(console: Console, part: Counts) -> None:
    """Print a table under its title."""
    table = FittedTable(*part.columns, title=part.title)
    for row in part.rows:
        table.add_row(*row)
    console.print(table)
