"""``netboard config``: check, show or create the configuration file."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.base.plural import plural
from netboard.base.terminal.shell import shell_command
from netboard.services.loading import DEFAULT_FILE, load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer(name="config", help="Check, show or create the configuration file.", no_args_is_help=True)


@app.command(epilog=examples("netboard config check rig.toml", "netboard config check --set block.trials=6"))
def check(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="The same as --config.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Check the configuration, and list every error."""
    from netboard.base.config import digest
    from netboard.devices.contract import registry
    from netboard.recording.format.disk import require_writable
    from netboard.stage.stage import make_stage

    if file is not None and config is not None:
        raise ConfigError("config check: found a FILE and --config, expected one of them")
    config = config or file
    settings = load(config, overrides)
    make_stage(settings)
    registry.check(settings)
    require_writable(Path(settings.recording.directory), "[recording] directory")
    source = config or (DEFAULT_FILE if DEFAULT_FILE.exists() else "defaults")
    block = settings.block
    typer.echo(f"{source}: valid ({block.configuration}, {plural(block.trials, 'trial')}, {digest(settings)[:12]})")


@app.command(epilog=examples("netboard config show", "netboard config show --set block.trials=6"))
def show(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """Print the complete configuration, as it is stored in a recording."""
    from netboard.base.config import resolve

    typer.echo(resolve(load(config, overrides)), nl=False)


@app.command(epilog=examples("netboard config init", "netboard config init rig.toml"))
def init(file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to create.")] = DEFAULT_FILE) -> None:
    """Create a commented file with every setting, its default, unit and limits."""
    from netboard.base.config import template
    from netboard.base.files.new import new_file

    with new_file(file) as part:
        part.write_text(template(), encoding="utf-8", newline="\n")
    typer.echo(f"{file}: created; after editing, check it with: {shell_command('netboard', 'config', 'check', file)}")
