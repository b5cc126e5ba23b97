"""The ``netboard`` command, and the table of its subcommands.

A command is imported when it is looked up, and its libraries when it runs. So a command starts without the others,
``netboard --help`` is fast, and a machine needs only the libraries of its own services.
"""

import io
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any

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
        "trace",
        "check",
        "recover",
        "sessions",
        "whatif",
        "export",
        "import",
    ),
    "Analysis and simulation": (
        "analyse",
        "explain",
        "simulate",
        "cohort",
        "power",
        "participants",
        "train",
        "bench",
    ),
    "Set-up": ("doctor", "config", "keys", "devices"),
}
"""Commands, in the groups and in the order in which ``netboard --help`` lists them."""

MODULES = {
    "trace": "tracing",
    "import": "importing",
    "participants": "participants.group",
    "train": "train.group",
    "bench": "bench.group",
    "config": "configuration",
    "devices": "devices.group",
}
"""Modules of this package whose name differs from that of their command."""

PANELS = {name: panel for panel, names in COMMANDS.items() for name in names}


class CommandTable(Mapping[str, Any]):
    """All commands by name. Each is imported when it is looked up, so that one starts without the others."""

    def __init__(self) -> None:
        self._found: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._found:
            panel = PANELS[name]
            holder = typer.Typer(add_completion=False, rich_markup_mode="rich")
            holder.add_typer(import_module(f"netboard.services.{MODULES.get(name, name)}").app)
            group: Any = typer.main.get_command(holder)
            self._found[name] = group.commands[name]
            self._found[name].rich_help_panel = panel
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(PANELS)

    def __len__(self) -> int:
        return len(PANELS)

    def __contains__(self, name: object) -> bool:
        return name in PANELS


class Netboard(Guarded):
    """The command ``netboard``, with all subcommands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = CommandTable()

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all subcommands."""
        return list(self.commands)


app = typer.Typer(
    cls=Netboard,
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
