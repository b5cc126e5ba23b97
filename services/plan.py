"""Plans of studies: ``netboard plan``. Nothing here needs a server, a device or a network."""

from typing import Annotated

import typer

from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides

app = typer.Typer(
    help="Show and check the plan of a study: which blocks, in which order, for which dyad.", no_args_is_help=True
)

STUDY_HELP = "Name of a built-in study, or a study file; NAME:ORDER selects another order."
Seed = Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Random seed of the plan.")]


@app.command(
    epilog="Examples:\n\n  netboard plan show --study paper --dyad 3\n\n"
    "  netboard plan show --study paper --dyads 8\n\n  netboard plan show --study paper:interleaved --json"
)
def show(
    study: Annotated[str, typer.Option(metavar="STUDY", help=STUDY_HELP)] = "paper",
    dyad: Annotated[int | None, typer.Option(min=1, help="Show the blocks of this dyad.")] = None,
    dyads: Annotated[
        int | None, typer.Option(min=1, max=1000, help="Show the counterbalancing over this many dyads.")
    ] = None,
    seed: Seed = 1,
    json: Annotated[bool, typer.Option("--json", help="Print one line of JSON.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Show the blocks of a dyad, and the counterbalancing over one or several dyads."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import studies as service

    raise typer.Exit(service.show(settings, service.load(study), seed, dyad, dyads, as_json=json))


@app.command(
    epilog="Examples:\n\n  netboard plan check study.toml\n\n  netboard plan check study.toml --dyads 12 -c rig.toml"
)
def check(
    study: Annotated[str, typer.Argument(metavar="STUDY", help=STUDY_HELP)],
    dyads: Annotated[int, typer.Option(min=1, max=1000, help="Number of dyads.")] = 8,
    seed: Seed = 1,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Check whether a study is valid; exit with 2 and the reasons if its trial counts are wrong."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import studies as service

    raise typer.Exit(service.check(settings, service.load(study), study, seed, dyads))


@app.command("list", epilog="Examples:\n\n  netboard plan list")
def list_() -> None:
    """List the built-in studies."""
    from netboard.services import studies as service

    raise typer.Exit(service.show_list())


@app.command(epilog="Examples:\n\n  netboard plan template > study.toml\n\n  netboard plan template paper > study.toml")
def template(
    study: Annotated[
        str, typer.Argument(metavar="NAME", help="Built-in study. Default: a template that explains each key.")
    ] = "",
) -> None:
    """Print a commented study file as a template."""
    from netboard.base.errors import ConfigError
    from netboard.task.studies import library

    if study and study not in library.NAMES:
        raise ConfigError(f"{study}: no built-in study; there are {', '.join(library.NAMES)}")
    typer.echo(library.text_of(study or library.TEMPLATE), nl=False)
