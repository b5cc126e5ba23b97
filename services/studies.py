"""A study by its name or file."""

from dataclasses import replace
from pathlib import Path

from netboard.base.errors import ConfigError
from netboard.task.studies import library
from netboard.task.studies.study import Study, parse_study, resolve_study


def load_study(word: str) -> Study:
    """Read a built-in study or a study file; ``:ORDER`` selects another order, ``:ONE,OTHER`` several in turn."""
    name, colon, orders = (word, "", "") if Path(word).is_file() else word.partition(":")
    study = parse_study(_text_of(name), name)
    if not colon:
        return study
    return parse_study(resolve_study(replace(study, order=tuple(orders.split(",")))), word)


def _text_of(name: str) -> str:
    """Read the text of a built-in study or of a file."""
    if name in library.NAMES:
        return library.text_of(name)
    try:
        return Path(name).read_text(encoding="utf-8")
    except FileNotFoundError:
        known = ", ".join(library.NAMES)
        raise ConfigError(f"{name}: no such study or file; the built-in studies are {known}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name}: cannot be read: {error}") from error
