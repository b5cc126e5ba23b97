"""The known word that an unknown one was probably meant to be: a key, a value, a column, a command."""

import difflib
from collections.abc import Collection, Iterable


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the most similar known word, in any case of letters; None if none is similar."""
    folded = {other.casefold(): other for other in known}
    found = difflib.get_close_matches(word.casefold(), folded, 1)
    return folded[found[0]] if found else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return the question to append to an error; empty if no known word is similar."""
    found = nearest(word, known)
    return f"; did you mean {found}?" if found else ""


def one_of(word: str, known: Collection[str]) -> str:
    """Return the known words, as an error says what was expected in place of one that is unknown."""
    return f"one of {', '.join(known) or 'none'}{did_you_mean(word, known)}"
