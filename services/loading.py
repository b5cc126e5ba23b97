"""Reading the files that options name: the configuration, the settings of an analysis, a study."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from netboard.base.errors import ConfigError
from netboard.base.files.text import read_text
from netboard.base.nearest import did_you_mean
from netboard.base.terminal.shell import shell_command

if TYPE_CHECKING:
    from netboard.analysis.extraction.settings import Readings
    from netboard.base.config import Config
    from netboard.task.studies.study import Study

DEFAULT_FILE = Path("netboard.toml")
"""Configuration that is used without ``--config``, if it exists."""


def load(file: Path | None, overrides: Sequence[str] | None = None, given: str = "--set") -> "Config":
    """Read the configuration from a file, else from ``netboard.toml`` if it exists, else take the defaults.

    ``given``: options of the command line that gave the overrides, for error messages.
    """
    from netboard.base.config import parse, require_effective, require_short_names

    if file is None and DEFAULT_FILE.exists():
        file = DEFAULT_FILE
    source, text = "defaults", ""
    if file is not None:
        missing = f"no such file; create it with: {shell_command('netboard', 'config', 'init', file)}"
        source, text = str(file), read_text(file, missing)
    config = parse(text, source, overrides or (), given)
    origin = f"{source} with {given}" if overrides else source
    require_short_names(config.session, origin)
    require_effective(config, origin)
    return config


def one_file(command: str, argument: Path | None, option: Path | None) -> Path | None:
    """Return the configuration of a command that takes it as an argument, too."""
    if argument is not None and option is not None:
        raise ConfigError(f"{command}: found a FILE and --config, expected one of them")
    return option or argument


def settings_text(file: Path | None) -> str:
    """Return the text of the settings of an analysis; empty for the defaults."""
    if file is None:
        return ""
    return read_text(file, f"no such file; create it with: netboard analyse --template > {shell_command(file)}")


def load_readings(file: Path | None, overrides: Sequence[str] | None, text: str | None = None) -> "Readings":
    """Read the settings of an analysis; ``text``: of their file, if it was read before."""
    from netboard.analysis.extraction import settings  # imports the whole analysis

    return settings.parse(settings_text(file) if text is None else text, str(file or "defaults"), overrides or ())


def load_study(word: str, config: "Config | None" = None) -> "Study":
    """Read a built-in study or a study file; ``:ORDER`` selects another order, ``:ONE,OTHER`` several in turn.

    ``config``: the rig's configuration, with which the study is used; warnings of the study are then printed.
    """
    from netboard.task.studies.level_keys import warnings_of

    study = _study_of(word)
    for warning in () if config is None else warnings_of(study, config):
        typer.echo(f"netboard: warning: {word}: {warning}", err=True)
    return study


def _study_of(word: str) -> "Study":
    """Read a study by the word that names it."""
    from netboard.task.studies import library
    from netboard.task.studies.study import parse_study, resolve_study

    name, colon, orders = (word, "", "") if Path(word).is_file() else word.partition(":")
    known = ", ".join(library.names()) + did_you_mean(name, library.names())
    missing = f"no such study or file; the built-in studies are {known}"
    text = library.text_of(name) if name in library.names() else read_text(Path(name), missing)
    study = parse_study(text, name)
    if not colon:
        return study
    return parse_study(resolve_study(replace(study, order=tuple(orders.split(",")))), word)
