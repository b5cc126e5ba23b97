"""Words that are declared once, and a check at import that all code that uses them knows all of them.

A word of the configuration, such as an extrapolation, is declared as a `Literal`. Code that computes with it lists the
words that it knows, and `require` compares the two, so that no unknown word is treated as another one.
"""

from collections.abc import Collection, Sequence
from typing import Any, Literal, get_args, get_type_hints

from netboard.base.errors import ConfigError
from netboard.base.nearest import one_of

Extrapolation = Literal["zoh", "cv", "ca"]
"""Extrapolation of a stylus after its newest sample; the number in kernels is its place."""

EXTRAPOLATIONS: tuple[Extrapolation, ...] = get_args(Extrapolation)
"""The same as a tuple."""


def require(what: str, known: Collection[str], declared: Collection[str]) -> None:
    """Check that code knows exactly the declared words.

    Parameters
    ----------
    what : str
        Name of the code, such as a kernel or a table, with its file.
    known : collection of str
        Words that the code handles.

    Raises
    ------
    RuntimeError
        If a word is missing or extra.
    """
    missing = [word for word in declared if word not in known]
    extra = [word for word in known if word not in declared]
    if missing or extra:
        found = "; ".join(f"{kind} {', '.join(words)}" for kind, words in (("lacks", missing), ("has", extra)) if words)
        raise RuntimeError(f"{what}: {found}; expected exactly what is declared: {', '.join(declared)}")


def words_of(table: Any, key: str) -> tuple[str, ...]:
    """Return the possible words of a configuration key.

    Parameters
    ----------
    table : type
        Dataclass of the table.
    key : str
        A key whose type is a `Literal`.
    """
    return get_args(get_type_hints(table)[key])


def number_of(word: str, declared: Sequence[str], key: str) -> int:
    """Return the number of a word, its place in the declaration [1].

    Parameters
    ----------
    word : str
        Value of the key.
    key : str
        Name for the error message, such as ``[physics] hold``.

    Raises
    ------
    ConfigError
        If the word is not declared.
    """
    if word not in declared:
        raise ConfigError(f'{key}: found "{word}", expected {one_of(word, declared)}')
    return declared.index(word)
