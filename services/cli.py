"""The ``netboard`` command, and the table of its subcommands.

A command imports its libraries when it runs, so that ``netboard --help`` is fast and a machine needs only the libraries
of its own services.
"""

import io
import sys
from importlib import import_module
from typing import Annotated

import typer

from netboard.services.guard import OK, Guarded
from netboard.services.options import examples

COMMANDS = {
    "Run an experiment": (
        "demo",
        "launch",
        "up",
        "server",
        "agent",
        "display",
        "logger",
        "station",
        "lsl",
        "trigger",
        "plan",
        "session",
    ),
    "Operate a session": ("console", "status", "control", "stop"),
    "Recordings": (
        "replay",
        "info",
        "example",
        "tracing",
        "check",
        "recover",
        "sessions",
        "whatif",
        "export",
        "importing",
    ),
    "Analysis and simulation": (
        "analyse",
        "explain",
        "simulate",
        "cohort",
        "power",
        "participants.group",
        "train.group",
        "bench.group",
    ),
    "Set-up": ("doctor", "configuration", "keys", "devices.group"),
}
"""Modules of this package, in the groups and in the order in which ``netboard --help`` lists their commands."""

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
    """Run the command; what a terminal cannot show, such as a Japanese name in Latin-1, is printed as its code."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    app()


if __name__ == "__main__":
    main()
