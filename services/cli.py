"""The ``netboard`` command: its subcommands and the handling of their errors.

A command imports its libraries when it runs, so that ``netboard --help`` is fast and a machine needs only the libraries
of its own services. Exit codes: 0 clean, 1 fault, 2 wrong configuration or usage. An expected error (`NetboardError`)
is printed as one line on stderr; ``--debug`` shows its traceback.
"""

from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from netboard.base.errors import ConfigError, NetboardError
from netboard.services.options import examples, missing_extra

COMMANDS = {
    "Run an experiment": ("demo", "up", "server", "agent", "display", "logger", "lsl", "plan", "session"),
    "Operate a session": ("console", "status", "control"),
    "Recordings": ("replay", "info", "tracing", "check", "recover", "sessions", "whatif", "export", "importing"),
    "Analysis and simulation": ("analyse", "explain", "simulate", "cohort", "power", "bench"),
    "Set-up": ("doctor", "configuration", "keys", "devices"),
}
"""Modules of this package, in the groups and in the order in which ``netboard --help`` lists their commands."""

OK, FAULT, WRONG = 0, 1, 2


class Guarded(TyperGroup):
    """A group of commands that turns expected errors into one line and an exit code."""

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
    help="Networked dyadic haptic experiment: two people with haptic devices balance a virtual ball on a board.",
    epilog=examples(
        "netboard demo", "netboard config init", "netboard server -c rig.toml", "netboard agent --side left -c rig.toml"
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["--help", "-h"]},
)
for panel, modules in COMMANDS.items():
    for module in modules:
        part: typer.Typer = import_module(f"netboard.services.{module}").app
        if not part.info.name:  # its commands become commands of netboard, and are listed one by one
            for command in part.registered_commands:
                command.rich_help_panel = panel
        app.add_typer(part, rich_help_panel=panel)


def _print_version(wanted: bool) -> None:
    """Print the version and stop, if asked."""
    if wanted:
        import platform
        from importlib.metadata import version

        typer.echo(f"netboard {version('netboard')} (Python {platform.python_version()}, {platform.platform()})")
        raise typer.Exit(OK)


@app.callback()
def root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the full traceback of errors.")] = False,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version, and stop.")
    ] = False,
) -> None:
    """Take the options that go before the command; `Guarded` reads ``debug``."""


def main() -> None:
    """Run the command."""
    app()


if __name__ == "__main__":
    main()
