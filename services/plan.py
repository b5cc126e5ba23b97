"""``netboard plan``: plans of studies, without a server, a device or a network."""

from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.base.nearest import one_of
from netboard.services.loading import load, load_study
from netboard.services.options import STUDY_HELP, ConfigFile, Json, Overrides, PlanSeed, Study, examples

app = typer.Typer(
    name="plan",
    help="Show and check the plan of a study: which blocks, in which order, for which dyad.",
    no_args_is_help=True,
)


@app.command(
    epilog=examples(
        "netboard plan show --study paper --dyad 3",
        "netboard plan show --study paper --dyads 8",
        "netboard plan show --study paper:interleaved --json",
    )
)
def show(
    argument: Annotated[str, typer.Argument(metavar="STUDY", help="The study, instead of --study.")] = "",
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
    from netboard.base.terminal.output import plain_console
    from netboard.task.plans.plan import plan_of
    from netboard.task.plans.tables import examine, plan_as_json, plan_in_words, refuse

    found, console = load_study(argument or study, settings), plain_console()
    shown = plan_of(found, seed, dyad or 1, (settings.session.hand_a, settings.session.hand_b))
    counted = [plan_of(found, seed, number) for number in range(1, dyads + 1)] if dyads else [shown]
    balance, problems = examine(settings, found, counted, [shown])
    if json:
        typer.echo(plan_as_json(shown, balance, problems))
    else:
        for part in plan_in_words(found, shown, balance, blocks=bool(dyad or not dyads)):
            console.print(part)
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
    from netboard.base.terminal.output import plain_console
    from netboard.devices.triggers import registry as trigger_boxes
    from netboard.participants.seat.partners import problems_of
    from netboard.task.plans.plan import configs_of, plan_of
    from netboard.task.plans.tables import examine, fitted, refuse, valid_in_words

    trigger_boxes.require_known(settings.triggers)
    found, console = load_study(study, settings), plain_console(soft_wrap=True)
    plans = [plan_of(found, seed, number) for number in range(1, dyads + 1)]
    balance, problems = examine(settings, found, plans)
    if not problems:
        problems = problems_of(one for made in plans for one in configs_of(settings, made))
    for part in [fitted(balance.tables[0])] if problems else valid_in_words(study, found, plans, balance):
        console.print(part)
    refuse(problems)


@app.command("list", epilog=examples("netboard plan list"))
def list_() -> None:
    """List the built-in studies."""
    from netboard.base.terminal.output import plain_console
    from netboard.task.plans.tables import studies_table
    from netboard.task.studies import library

    plain_console().print(studies_table([load_study(name) for name in library.names()]))


@app.command(epilog=examples("netboard plan template > study.toml", "netboard plan template paper > study.toml"))
def template(
    study: Annotated[
        str, typer.Argument(metavar="NAME", help="A built-in study; default: a template that explains each key.")
    ] = "",
) -> None:
    """Print a commented study file as a template."""
    from netboard.task.studies import library

    if study and study not in library.names():
        raise ConfigError(f"{study}: no such built-in study, expected {one_of(study, library.names())}")
    typer.echo(library.text_of(study or library.TEMPLATE), nl=False)
