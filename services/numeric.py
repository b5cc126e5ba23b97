"""Numbers among the options and arguments of all commands: read as in files, not as Python's literals.

``--dyads 1_2`` is not twelve, and no option takes an infinite number.
"""

from collections.abc import Sequence
from typing import Any, get_args, get_type_hints

import typer

from netboard.base.errors import ConfigError
from netboard.base.number import number_of, whole_of

_READERS = {int: ("a whole number", whole_of), float: ("a number", number_of)}
"""What an option of each type is, and how it is read."""


def read_strictly(command: Any) -> None:
    """Let a command, or all commands of a group, read numbers strictly."""
    for parameter, kind in numeric_parameters(command):
        _guard(parameter, kind)
    for one in getattr(command, "commands", {}).values():
        read_strictly(one)


def numeric_parameters(command: Any) -> list[tuple[Any, type]]:
    """Return the options and arguments of a command that are numbers, with their types."""
    hints = get_type_hints(command.callback) if command.callback is not None else {}
    kinds = {name: {hint, *get_args(hint)} & _READERS.keys() for name, hint in hints.items()}
    return [(one, kind) for one in command.params for kind in kinds.get(one.name, ())]


def _guard(parameter: Any, kind: type) -> None:
    """Refuse what is no number to people before the command line converts it."""
    (words, read), process = _READERS[kind], parameter.process_value

    def process_value(context: Any, value: Any) -> Any:
        if isinstance(value, str):
            try:
                read(value)
            except ValueError:
                raise typer.BadParameter(f'found "{value}", expected {words}', context, parameter) from None
        return process(context, value)

    parameter.process_value = process_value


def numbers_of(option: str, words: Sequence[str]) -> tuple[float, ...]:
    """Read the numbers of an option that may be repeated, or separated by commas."""
    try:
        return tuple(number_of(word.strip()) for given in words for word in given.split(","))
    except ValueError:
        raise ConfigError(f"{option}: found {' '.join(words)}, expected numbers separated by commas") from None


def whole_numbers_of(option: str, text: str, least: int) -> tuple[int, ...]:
    """Read whole numbers with commas, none below the least one, each once and in order."""
    try:
        found = {whole_of(word.strip()) for word in text.split(",")}
    except ValueError:
        found = {least - 1}
    if min(found) < least:
        raise ConfigError(f"{option}: found {text}, expected whole numbers from {least}, with commas")
    return tuple(sorted(found))
