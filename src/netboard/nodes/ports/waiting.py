"""What a block waits for, in words for operators."""

from collections.abc import Iterable, Sequence

_LEFT, _RIGHT = "the left ", "the right "


def in_words(missing: Sequence[str]) -> str:
    """Return a list of missing things in one phrase, with what is missing at both sides named once."""
    *first, last = _joined(missing) or [""]
    return f"{', '.join(first)} and {last}" if first else last


def _joined(missing: Sequence[str]) -> list[str]:
    """Replace what is missing at the left and at the right by what is missing at both sides."""
    return list(dict.fromkeys(_of_both(one, missing) for one in missing))


def _of_both(one: str, missing: Iterable[str]) -> str:
    for side, other in ((_LEFT, _RIGHT), (_RIGHT, _LEFT)):
        if one.startswith(side) and other + (rest := one.removeprefix(side)) in missing:
            noun, space, state = rest.partition(" ")
            return f"both {noun}s{space}{state}"
    return one
