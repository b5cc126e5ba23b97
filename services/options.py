"""Shared parts of commands: options, reading the configuration, examples in help texts.

Importing a command must be quick, because ``netboard --help`` imports them all: libraries are imported when they are
needed, and so is `netboard.base.config`.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError

if TYPE_CHECKING:
    from netboard.base.config import Config

Side = Literal["left", "right"]  # as in netboard.base.config, which takes too long to import here

DEFAULT_FILE = Path("netboard.toml")
USED_FILE = "Configuration file (TOML); default: ./netboard.toml if it exists, else the built-in defaults."

ConfigFile = Annotated[Path | None, typer.Option("--config", "-c", metavar="FILE", help=USED_FILE)]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="TABLE.KEY=VALUE", help="Override one setting; repeat for several."),
]
HandSide = Annotated[Side, typer.Option(help="Side of the board that the device moves.")]
Json = Annotated[bool, typer.Option("--json", help="Print one line of JSON.")]
Screenshot = Annotated[Path | None, typer.Option(metavar="FILE", help="Save the first frame as a PNG file, then stop.")]
ScreenshotDelay = Annotated[
    float | None,
    typer.Option(
        min=0, metavar="SECONDS", help="Take the screenshot this long after the first data, and keep the window open."
    ),
]
Offscreen = Annotated[bool, typer.Option("--offscreen", help="Render without a screen.")]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Accept connections from other machines without encryption.")
]
Model = Annotated[
    Literal["paper", "lagrangian"] | None, typer.Option(help="Physics model; the same as --set physics.model=...")
]
STUDY_HELP = "Name of a built-in study (netboard plan list) or a study file; NAME:ORDER selects another order."
Study = Annotated[str, typer.Argument(metavar="STUDY", help=STUDY_HELP)]
SessionOf = Annotated[
    str | None, typer.Option(metavar="NAME|FILE", help="Run a session of this study instead of a single block.")
]
Dyad = Annotated[int, typer.Option(min=1, help="Number of the dyad in the study.")]
PlanSeed = Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Random seed of the plan.")]
Blocks = Annotated[int | None, typer.Option(min=1, help="Run only the first blocks (pilot runs).")]
Trials = Annotated[int | None, typer.Option(min=1, help="Limit the trials per block (pilot runs).")]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="The recording (.mcap).")]
Recordings = Annotated[list[Path], typer.Argument(metavar="RECORDING", help="Recordings, or folders of recordings.")]
Workers = Annotated[int | None, typer.Option(min=1, metavar="N", help="Processes; default: one per core.")]
Dask = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Use a Dask cluster, for example tcp://10.0.0.5:8786.")
]
NewFolder = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FOLDER", help="New folder; default: named after the first recording."),
]

IMPORTED_AS = {"hid": "hidapi", "usb": "pyusb"}
"""Packages whose module has another name."""


def load(file: Path | None, overrides: Sequence[str] | None = None) -> "Config":
    """Read the configuration from a file, else from ``netboard.toml`` if it exists, else take the defaults."""
    from netboard.base.config import parse

    if file is None:
        if not DEFAULT_FILE.exists():
            return parse("", "defaults", overrides or ())
        file = DEFAULT_FILE
    return parse(text_of(file, f"netboard config init {file}"), str(file), overrides or ())


def changes_of(overrides: Sequence[str] | None, model: str | None) -> list[str]:
    """Return the overrides, and --model as another one."""
    return [*(overrides or ()), *([f"physics.model={model}"] if model else ())]


def text_of(file: Path, create: str) -> str:
    """Read a file of settings; `create` is the command that creates one."""
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such file; create it with: {create}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read: {error}") from error


def examples(*lines: str) -> str:
    """Return the epilog of a help text."""
    return "\n\n".join(("Examples:", *(f"  {line}" for line in lines)))


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
