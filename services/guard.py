"""Errors and exit codes of all commands: 0 clean, 1 fault, 2 wrong configuration or usage.

An expected error (`NetboardError`), a file or folder that cannot be used, and a library that is missing are one line on
stderr; ``--debug`` shows the traceback.
"""

import errno
import io
import logging
import os
import re
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from netboard.base.compilation import UNKNOWN, Forecast, compilation
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.system.c_library import has_reader
from netboard.base.terminal.errors import print_error
from netboard.services.values import read_strictly

if TYPE_CHECKING:
    from netboard.base.terminal.compiling import CompilationBar

IMPORTED_AS = {
    "PIL": "pillow",
    "PySide6": "PySide6-Essentials",
    "hid": "hidapi",
    "stable_baselines3": "stable-baselines3",
    "usb": "pyusb",
}
"""Packages whose module has another name."""

BINARIES = (".so", ".pyd", ".dylib")
"""Suffixes of compiled modules, which may need libraries of the system."""

PYDANTIC = "Value error, "
"""What pydantic, by which typer checks a choice, writes before the message."""

OK, FAULT, WRONG = 0, 1, 2

KERNELS = {
    "server": Forecast(110, (0.05, 0.10, 0.15, 0.20, 0.29, 0.36, 0.49, 0.67, 0.80, 1.0)),
    "agent": Forecast(120, (0.10, 0.25, 0.41, 0.48, 0.57, 0.70, 0.76, 0.81, 0.88, 1.0)),
}
"""What a command compiles with an empty cache."""


class Guarded(TyperGroup):
    """A group of commands that turns expected errors into one line and an exit code."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options; ``--help`` prints at once."""
        try:
            return super().parse_args(ctx, args)
        except OSError as error:
            words, code = expected(error)
            print_error(words)
            raise typer.Exit(code) from error

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Find the command, which reads numbers as files do."""
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None:
            read_strictly(command)
        return name, command, rest

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand."""
        try:
            with compilation.watched(lambda: _bar_of(ctx.invoked_subcommand)):
                return _unhidden(super().invoke, ctx)
        except (NetboardError, OSError, ImportError, MemoryError) as error:
            words, code = expected(error)
            if ctx.params["debug"] or not words:
                raise
        except typer.BadParameter as error:
            error.message = error.message.removeprefix(PYDANTIC)
            raise
        except KeyboardInterrupt:
            words, code = "interrupted", FAULT
        for handler in logging.getLogger().handlers:
            handler.flush()  # the error is the last line
        print_error(words)
        raise typer.Exit(code)


def _bar_of(command: str | None) -> "CompilationBar":
    """Return what shows that a command compiles."""
    from netboard.base import kernel_cache
    from netboard.base.terminal.compiling import CompilationBar

    return CompilationBar(KERNELS.get(command or "", UNKNOWN).with_cached(kernel_cache.count()))


def _unhidden(run: Callable[[Any], Any], ctx: Any) -> Any:
    """Run a command; give an error that Typer would hide another class, which shows its traceback.

    Typer prints "Aborted." for an EOFError, as of a truncated file, and nothing for a broken pipe, as of a process that
    has ended: it assumes that the user has closed the input or the output.
    """
    try:
        return run(ctx)
    except EOFError as error:
        raise RuntimeError(f"a file or a connection ended too early: {error!r}") from error
    except BrokenPipeError as error:
        if reader_has_left():
            raise
        raise RuntimeError(f"a process or peer has closed its connection: {error!r}") from error


def reader_has_left() -> bool:
    """Tell whether the program that reads this one's output, such as ``head``, has ended."""
    return not has_reader()


def expected(error: NetboardError | OSError | ImportError | MemoryError) -> tuple[str, int]:
    """Return what an error tells the user, and the exit code; no words if it is a fault of netboard itself."""
    match error:
        case ConfigError():
            return str(error), WRONG
        case NetboardError():
            return str(error), FAULT
        case OSError() if error.filename is None and error.errno == errno.ENOSPC:
            _drop_output()
            return "the output cannot be written: the disk is full", FAULT
        case OSError() if error.filename is None and error.errno == errno.ENOENT:  # from os.getcwd
            return "this folder has been deleted; change to another one", FAULT
        case OSError():  # such as a file name that is too long, or a folder that may not be read
            return "" if error.filename is None else f"{error.filename}: {error.strerror}", FAULT
        case MemoryError():
            return "the memory of this computer is full; close other programs, or take a shorter recording", FAULT
        case ModuleNotFoundError():
            return missing_extra(error), WRONG
        case ImportError() if (error.path or "").endswith(BINARIES):
            return f"{error.name} cannot be loaded: {error}; install that library: deploy/setup.sh run", WRONG
    return "", FAULT


def _drop_output() -> None:
    """Write what is still to be printed nowhere: Python would try again at its end, and fail with other words."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


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
