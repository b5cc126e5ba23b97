"""Parser for the order of a study's blocks, such as ``4 solo, 6 dyadic, 2 solo``.

A name stands for a block of that kind (or for one block each, if A and B perform it in turn). A number repeats the name
or group after it, brackets group, ``/`` is a long rest, and ``|`` begins the next session. Commas are optional.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from netboard.base.errors import ConfigError

MOST = 1000
"""Most steps of an order [1]."""

_TOKEN = re.compile(r"\s*([0-9]{1,4}|[A-Za-z][A-Za-z0-9_-]*|[(),/|])")


@dataclass(frozen=True, slots=True)
class Step:
    """One step of an order."""

    kind: str
    rested: bool


def steps_of(text: str) -> tuple[tuple[Step, ...], ...]:
    """Parse an order; return the steps of each session."""
    sessions: list[list[Step]] = [[]]
    rested = False
    for word in _expanded(text):
        if word == "|":
            sessions.append([])
            rested = False
        elif word == "/":
            rested = True
        else:
            sessions[-1].append(Step(word, rested))
            rested = False
    if not all(sessions):
        raise ConfigError("a session without blocks; expected kinds of blocks before and after every |")
    return tuple(tuple(steps) for steps in sessions)


def _expanded(text: str) -> list[str]:
    """Expand numbers and brackets; return only names, ``/`` and ``|``."""
    stack: list[tuple[int, list[str]]] = [(1, [])]
    times: int | None = None
    for word in _words(text):
        if times is not None and not (word == "(" or word[0].isalpha()):
            raise ConfigError(f"found {word} after the number {times}, expected a kind of block or a bracket (")
        if word[0].isdigit():
            times = int(word)
            if not 1 <= times <= MOST:
                raise ConfigError(f"found the number {times}, expected 1 to {MOST}")
            continue
        if word == "(":
            stack.append((times or 1, []))
        elif word == ")":
            if len(stack) == 1:
                raise ConfigError("a bracket ) closes that was not opened")
            count, words = stack.pop()
            _append(stack[-1][1], words, count)
        elif word != ",":
            _append(stack[-1][1], [word], times or 1)
        times = None
    if times is not None:
        raise ConfigError(f"found nothing after the number {times}, expected a kind of block or a bracket (")
    if len(stack) > 1:
        raise ConfigError("a bracket ( is not closed")
    return stack[0][1]


def _append(words: list[str], more: list[str], times: int) -> None:
    """Append words a number of times; raise ConfigError if there are too many."""
    if len(words) + len(more) * times > MOST:
        raise ConfigError(f"more than {MOST} blocks")
    words += more * times


def _words(text: str) -> Iterator[str]:
    """Split an order into tokens."""
    place, end = 0, len(text.rstrip())
    while place < end:
        found = _TOKEN.match(text, place)
        if found is None:
            rest = text[place:end].strip()
            raise ConfigError(f'found "{rest[:20]}", expected kinds of blocks, numbers, brackets, commas, / and |')
        yield found[1]
        place = found.end()
