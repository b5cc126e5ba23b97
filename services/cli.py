"""The ``netboard`` command: its subcommands and the handling of their errors.

A service is imported only when it runs, so that ``netboard --help`` is fast and a machine needs only the libraries of
its own services. Exit codes: 0 clean, 1 fault, 2 wrong configuration or usage. An expected error (`NetboardError`) is
printed as one line on stderr; ``--debug`` shows its traceback.
"""

import platform
from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from netboard.base.errors import ConfigError, NetboardError
from netboard.services import (
    analysing,
    bench,
    configuration,
    demonstration,
    devices,
    keys,
    operating,
    plan,
    processes,
    recordings,
    scenes,
    session,
)
from netboard.services.wording import examples, missing_extra

OK, FAULT, WRONG = 0, 1, 2


class Guarded(TyperGroup):
    """A group of commands that turns netboard's own errors into one line and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand."""
        try:
            return super().invoke(ctx)
        except NetboardError as error:
            if ctx.params["debug"]:
                raise
            typer.secho(f"netboard: {error}", err=True, fg=typer.colors.RED)
            raise typer.Exit(WRONG if isinstance(error, ConfigError) else FAULT) from None
        except ModuleNotFoundError as error:
            advice = missing_extra(error)
            if ctx.params["debug"] or not advice:
                raise
            typer.secho(f"netboard: {advice}", err=True, fg=typer.colors.RED)
            raise typer.Exit(WRONG) from None
        except KeyboardInterrupt:
            typer.secho("netboard: interrupted", err=True, fg=typer.colors.RED)
            raise typer.Exit(FAULT) from None


app = typer.Typer(
    cls=Guarded,
    name="netboard",
    help="Two people, a curtain between them, balance a virtual ball on a board: a networked dyadic haptic experiment.",
    epilog=examples(
        "netboard demo", "netboard config init", "netboard server -c rig.toml", "netboard agent --side left -c rig.toml"
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["--help", "-h"]},
)
app.add_typer(configuration.app, name="config")
app.add_typer(bench.app, name="bench")
app.add_typer(devices.app, name="devices")
app.add_typer(keys.app, name="keys")
app.add_typer(plan.app, name="plan")
app.add_typer(session.app, name="session")


def _print_version(wanted: bool) -> None:
    """Print the version and stop, if asked."""
    if wanted:
        typer.echo(f"netboard {version('netboard')} (Python {platform.python_version()}, {platform.platform()})")
        raise typer.Exit(OK)


@app.callback()
def root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the full traceback of an error.")] = False,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and stop.")
    ] = False,
) -> None:
    """Take the options that go before the command; `Guarded` reads ``debug``."""


processes.add_to(app)
demonstration.add_to(app)
scenes.add_to(app)
operating.add_to(app)
recordings.add_to(app)
analysing.add_to(app)


def main() -> None:
    """Run the command."""
    app()


if __name__ == "__main__":
    main()
