"""Errors and exit codes of all commands: 0 clean, 1 fault, 2 wrong configuration or usage.

An expected error (`NetboardError`), a file or folder that cannot be used, and a library that is missing are one line on
stderr; ``--debug`` shows the traceback.
"""

import re
from typing import Any

import typer
from typer.core import TyperGroup

from netboard.base.errors import ConfigError, NetboardError

IMPORTED_AS = {"hid": "hidapi", "usb": "pyusb"}
"""Packages whose module has another name."""

BINARIES = (".so", ".pyd", ".dylib")
"""Suffixes of compiled modules, which may need libraries of the system."""

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
        except ImportError as error:
            if ctx.params["debug"] or not (error.path or "").endswith(BINARIES):
                raise
            typer.secho(
                f"netboard: {error.name} cannot be loaded: {error}; install that library: deploy/setup.sh run",
                err=True,
                fg=typer.colors.RED,
            )
            raise typer.Exit(WRONG) from None
        except OSError as error:
            if ctx.params["debug"] or error.filename is None:
                raise
            typer.secho(f"netboard: {error.filename}: {error.strerror}", err=True, fg=typer.colors.RED)
            raise typer.Exit(FAULT) from None
        except KeyboardInterrupt:
            typer.secho("netboard: interrupted", err=True, fg=typer.colors.RED)
            raise typer.Exit(FAULT) from None


def missing_extra(error: ModuleNotFoundError) -> str:
    """Return how to install a missing module with an extra of netboard; empty if no extra has it."""
    from importlib.metadata import requires

    module = (error.name or "").partition(".")[0]
    package = IMPORTED_AS.get(module, module)
    requirement = re.compile(r"(?P<package>[\w.-]+).*extra == [\"'](?P<extra>\w+)[\"']")
    for line in requires("netboard") or ():
        found = requirement.match(line)
        if found and found["package"].casefold() == package.casefold() and found["extra"] != "dev":
            return f"this needs {package}, which is not installed: pip install 'netboard[{found['extra']}]'"
    return ""
