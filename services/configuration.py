"""The configuration file: ``netboard config`` checks, shows and writes it.

Only this module turns a file into a `Config`. Commands that read it take `ConfigFile` and `Overrides`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.config import Config, digest, parse, resolve, template
from netboard.base.errors import ConfigError
from netboard.services.wording import examples

app = typer.Typer(help="Check, show or write the configuration file.", no_args_is_help=True)

if TYPE_CHECKING:
    from netboard.analysis.extraction.settings import Readings

DEFAULT_FILE = Path("netboard.toml")

ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        metavar="FILE",
        help="Configuration file (TOML). Default: ./netboard.toml if present, else built-in defaults.",
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="TABLE.KEY=VALUE", help="Override one setting; repeatable."),
]


def load(file: Path | None, overrides: Sequence[str] = ()) -> Config:
    """Read the configuration.

    Parameters
    ----------
    file : Path or None
        The given file; None takes ``netboard.toml`` in the working directory if it exists, else the defaults.
    """
    if file is None:
        if not DEFAULT_FILE.exists():
            return parse("", "defaults", overrides)
        file = DEFAULT_FILE
    return parse(_text_of(file, f"netboard config init {file}"), str(file), overrides)


def load_readings(file: Path | None, overrides: Sequence[str] = ()) -> "Readings":
    """Read the settings of an analysis."""
    from netboard.analysis.extraction import (
        settings as readings,  # imports the whole analysis, which other commands do not need
    )

    if file is None:
        return readings.parse("", "defaults", overrides)
    return readings.parse(_text_of(file, f"netboard analyse --template > {file}"), str(file), overrides)


def _text_of(file: Path, make: str) -> str:
    """Read a file of settings; `make` is the command that creates one."""
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such file; make one with: {make}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read: {error}") from error


@app.command(epilog=examples("netboard config check rig.toml", "netboard config check --set block.trials=6"))
def check(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="Configuration file; the same as --config.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Check the configuration and list every error."""
    from netboard.recording.format.disk import require_writable
    from netboard.stage.stage import make_stage

    if file is not None and config is not None:
        raise ConfigError("config check: found a FILE and --config, expected one of them")
    config = config or file
    settings = load(config, overrides or ())
    make_stage(settings)
    require_writable(Path(settings.recording.directory), "[recording] directory")
    source = config or (DEFAULT_FILE if DEFAULT_FILE.exists() else "defaults")
    block = settings.block
    typer.echo(f"{source}: in order ({block.configuration}, {block.trials} trials, {digest(settings)[:12]})")


@app.command(epilog=examples("netboard config show", "netboard config show --set block.trials=6"))
def show(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """Show the full configuration, as it is stored in a recording."""
    typer.echo(resolve(load(config, overrides or ())), nl=False)


@app.command(epilog=examples("netboard config init", "netboard config init rig.toml"))
def init(file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")] = DEFAULT_FILE) -> None:
    """Write a commented file with every setting, its default, unit and limits."""
    try:
        with file.open("x", encoding="utf-8", newline="\n") as new:
            new.write(template())
    except FileExistsError:
        raise ConfigError(f"{file}: is there already and is left as it is; name another file") from None
    except OSError as error:
        raise ConfigError(f"{file}: cannot be written: {error}") from error
    typer.echo(f"{file}: written; check it after editing with: netboard config check {file}")
