"""``netboard config``: check, show or create the configuration file."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import ConfigError, NetboardError
from netboard.base.plural import plural
from netboard.base.terminal.shell import shell_command
from netboard.services.loading import DEFAULT_FILE, load, one_file
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer(name="config", help="Check, show or create the configuration file.", no_args_is_help=True)


@app.command(epilog=examples("netboard config check rig.toml", "netboard config check --set block.trials=6"))
def check(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="The same as --config.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Check the configuration and the files that it names, and list every error."""
    from netboard.base.config import digest
    from netboard.devices.contract import registry
    from netboard.devices.setup.profiles import require_profiles
    from netboard.devices.triggers import registry as trigger_boxes
    from netboard.network.keys import require_keys
    from netboard.nodes.server.blocks import unrelated_in
    from netboard.participants.seat.partners import partners_of
    from netboard.recording.format.disk import require_writable
    from netboard.stage.stage import make_stage
    from netboard.windows.participant.language import load_words

    config = one_file("config check", file, config)
    settings = load(config, overrides)
    problems = []
    for one in (
        lambda: make_stage(settings),
        lambda: partners_of(settings),
        lambda: registry.check(settings),
        lambda: trigger_boxes.require_known(settings.triggers),
        lambda: require_profiles(Path(settings.agents.profiles)),
        lambda: require_keys(settings.network),
        lambda: load_words(settings.display.language),
        lambda: unrelated_in(settings.block.unrelated) if settings.block.unrelated else None,
        lambda: require_writable(Path(settings.recording.directory), "[recording] directory"),
    ):
        try:
            one()
        except NetboardError as error:
            problems.append(str(error))
    if problems:
        raise ConfigError("\n".join(problems))
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
