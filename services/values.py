"""Values of the options and arguments of all commands: numbers as in files, and words with the one that was meant.

``--dyads 1_2`` is not twelve, no option takes an infinite number, and ``netboard control strat`` asks about ``start``.
"""

from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args, get_origin, get_type_hints

import typer

from netboard.base.errors import ConfigError
from netboard.base.nearest import one_of
from netboard.base.number import number_of, whole_of


def _require_number(word: str) -> None:
    _require(number_of, word, "a number")


def _require_whole(word: str) -> None:
    _require(whole_of, word, "a whole number")


def _require(read: Callable[[str], float], word: str, expected: str) -> None:
    try:
        read(word)
    except ValueError:
        raise ConfigError(f'found "{word}", expected {expected}') from None


def _require_one_of(words: tuple[str, ...]) -> Callable[[str], None]:
    def require(word: str) -> None:
        if word not in words:
            raise ConfigError(f'found "{word}", expected {one_of(word, words)}')

    return require


_CHECKS = {int: _require_whole, float: _require_number}


def read_strictly(command: Any) -> None:
    """Let a command, or all commands of a group, refuse what its options do not take, in words."""
    for parameter, check in checked_parameters(command):
        _guard(parameter, check)
    for one in getattr(command, "commands", {}).values():
        read_strictly(one)


def checked_parameters(command: Any) -> list[tuple[Any, Callable[[str], None]]]:
    """Return the options and arguments of a command that are numbers or words of a list, with their checks."""
    hints = get_type_hints(command.callback) if command.callback is not None else {}
    checks = {name: _check_of(hint) for name, hint in hints.items()}
    return [(one, check) for one in command.params if (check := checks.get(one.name)) is not None]


def _check_of(hint: object) -> Callable[[str], None] | None:
    """Return the check of a type, or of the type in an optional one."""
    for kind in (hint, *get_args(hint)):
        if get_origin(kind) is Literal:
            return _require_one_of(get_args(kind))
        if kind in _CHECKS:
            return _CHECKS[kind]
    return None


def _guard(parameter: Any, check: Callable[[str], None]) -> None:
    """Check a value before the command line converts it."""
    process = parameter.process_value

    def process_value(context: Any, value: object) -> Any:
        if isinstance(value, str):
            try:
                check(value)
            except ConfigError as error:
                raise typer.BadParameter(str(error), context, parameter) from None
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
