"""What the help texts of all commands have in common."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import requires
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

REQUIREMENT = re.compile(r"(?P<package>[\w.-]+).*extra == [\"'](?P<extra>\w+)[\"']")
"""A package of an extra, as netboard's metadata lists it."""

Screenshot = Annotated[Path | None, typer.Option(metavar="FILE", help="Save a screenshot (PNG) and stop.")]
Dyad = Annotated[int, typer.Option(min=1, help="Number of the dyad in the study.")]


IMPORTED_AS = {"hid": "hidapi", "usb": "pyusb"}
"""Packages by the names of their modules, where these differ."""


def missing_extra(error: ModuleNotFoundError) -> str:
    """Return which extra of netboard installs a missing module; empty if none does."""
    module = (error.name or "").partition(".")[0]
    package = IMPORTED_AS.get(module, module)
    for line in requires("netboard") or ():
        found = REQUIREMENT.match(line)
        if found and found["package"].casefold() == package.casefold() and found["extra"] != "dev":
            return f"this needs {package}, which is not installed: pip install 'netboard[{found['extra']}]'"
    return ""


def examples(*lines: str) -> str:
    """Return the epilog of a help text."""
    return "\n\n".join(("Examples:", *(f"  {line}" for line in lines)))


@contextmanager
def telling() -> Iterator[Callable[[str, int, int], None]]:
    """Show a progress bar on stderr, if that is a terminal; yield its callback (current step, done, total)."""
    screen = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as progress:
        task = progress.add_task("")

        def tell(what: str, done: int, total: int) -> None:
            progress.update(task, description=escape(what), completed=done, total=total)

        yield tell
