"""``netboard plan``: plans of studies, without a server, a device or a network."""

import json as jsonlib
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load, load_study
from netboard.services.options import STUDY_HELP, ConfigFile, Json, Overrides, PlanSeed, Study, examples

if TYPE_CHECKING:
    from rich.console import Console

    from netboard.base.config import Config
    from netboard.task.plans.balance import Table
    from netboard.task.studies.study import Study as StudyData

app = typer.Typer(
    name="plan",
    help="Show and check the plan of a study: which blocks, in which order, for which dyad.",
    no_args_is_help=True,
)

MOST = 6
"""Number of problems that are shown."""


@app.command(
    epilog=examples(
        "netboard plan show --study paper --dyad 3",
        "netboard plan show --study paper --dyads 8",
        "netboard plan show --study paper:interleaved --json",
    )
)
def show(
    study: Annotated[str, typer.Option(metavar="STUDY", help=STUDY_HELP)] = "paper",
    dyad: Annotated[int | None, typer.Option(min=1, help="Show the blocks of this dyad.")] = None,
    dyads: Annotated[
        int | None, typer.Option(min=1, max=1000, help="Show the counterbalancing over this many dyads.")
    ] = None,
    seed: PlanSeed = 1,
    json: Json = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Show the blocks of a dyad, and the counterbalancing over one or several dyads."""
    settings = load(config, overrides)
    from rich.console import Console

    from netboard.task.plans import plan as plans
    from netboard.task.plans.balance import balance_of
    from netboard.task.plans.tables import blocks_table, levels_table, misfits

    found, console = load_study(study), Console()
    shown = plans.plan_of(found, seed, dyad or 1, (settings.session.hand_a, settings.session.hand_b))
    counted = [plans.plan_of(found, seed, number) for number in range(1, dyads + 1)] if dyads else [shown]
    balance = balance_of(found, counted)
    problems = [*balance.problems, *misfits(settings, [*counted, shown])]
    if json:
        whole = jsonlib.loads(plans.to_json(shown))
        more = {"digest": plans.digest(shown), "balance": asdict(balance), "problems": problems}
        typer.echo(jsonlib.dumps({**whole, **more}))
    else:
        if dyad or not dyads:
            console.print(f"[bold]{found.name}[/bold]: {found.text}", highlight=False)
            digest = plans.digest(shown)[:12]
            console.print(f"dyad {shown.dyad}, seed {seed}, order {shown.order}, A sits {shown.seat_a}, {digest}")
            if found.factors:
                print_table(console, levels_table(found))
            for session in shown.sessions:
                print_table(console, blocks_table(found, session))
        for table in balance.tables:
            print_table(console, table)
    refuse(problems)


@app.command(epilog=examples("netboard plan check study.toml", "netboard plan check study.toml --dyads 12 -c rig.toml"))
def check(
    study: Study,
    dyads: Annotated[int, typer.Option(min=1, max=1000, help="Number of dyads.")] = 8,
    seed: PlanSeed = 1,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Check whether a study is valid and its trial counts are balanced; exit code 2 and the reasons if not."""
    settings = load(config, overrides)

    check_study(settings, load_study(study), study, seed, dyads)


def check_study(config: "Config", study: "StudyData", name: str, seed: int, dyads: int) -> None:
    """Check that plans have the expected trial counts, and that each block makes a valid configuration with the rig."""
    from rich.console import Console

    from netboard.task.plans.balance import balance_of
    from netboard.task.plans.plan import plan_of
    from netboard.task.plans.tables import misfits, valid_in_words

    plans = [plan_of(study, seed, number) for number in range(1, dyads + 1)]
    balance = balance_of(study, plans)
    problems = [*balance.problems, *misfits(config, plans)]
    console = Console(soft_wrap=True, highlight=False)
    if problems:
        print_table(console, balance.tables[0])
    else:
        for line in valid_in_words(name, study, plans, balance):
            console.print(line)
    refuse(problems)


@app.command("list", epilog=examples("netboard plan list"))
def list_() -> None:
    """List the built-in studies."""
    from rich.console import Console

    from netboard.base.terminal import FittedTable
    from netboard.task.studies import library

    studies = {name: load_study(name) for name in library.NAMES}
    rows = [(name, study.text, ", ".join(study.orders)) for name, study in studies.items()]
    Console().print(FittedTable("study", "description", "orders", rows=rows))


@app.command(epilog=examples("netboard plan template > study.toml", "netboard plan template paper > study.toml"))
def template(
    study: Annotated[
        str, typer.Argument(metavar="NAME", help="A built-in study; default: a template that explains each key.")
    ] = "",
) -> None:
    """Print a commented study file as a template."""
    from netboard.task.studies import library

    if study and study not in library.NAMES:
        raise ConfigError(f"{study}: no such built-in study; there are {', '.join(library.NAMES)}")
    typer.echo(library.text_of(study or library.TEMPLATE), nl=False)


def refuse(problems: Sequence[str]) -> None:
    """Refuse a study with problems."""
    if problems:
        more = [f"and {len(problems) - MOST} more like these"] if len(problems) > MOST else []
        raise ConfigError("\n".join(["the study is not valid", *problems[:MOST], *more]))


def print_table(console: "Console", part: "Table") -> None:
    """Print a table under its title."""
    from netboard.base.terminal import FittedTable

    console.print(FittedTable(*part.columns, rows=part.rows, title=part.title))
