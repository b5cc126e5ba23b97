"""Words that are declared once, and whatever must know all of them: it says at import what is missing.

A word of the configuration, such as an extrapolation, is declared as a `Literal`. What computes with it names the
words that it knows, and `require` compares the two, so that no unknown word falls into a branch that is for another.
"""

from collections.abc import Collection, Sequence
from typing import Any, Literal, get_args, get_type_hints

from netboard.base.errors import ConfigError

Extrapolation = Literal["zoh", "cv", "ca"]
"""How a stylus moves after its last sample; the number in kernels is its place."""

EXTRAPOLATIONS: tuple[Extrapolation, ...] = get_args(Extrapolation)
"""The same as a tuple."""


def require(what: str, known: Collection[str], declared: Collection[str]) -> None:
    """Make sure that something knows all that is declared, and nothing else.

    Parameters
    ----------
    what : str
        What must know the words, such as a kernel or a table, and in which file it is.
    known : collection of str
        The words that it knows.
    declared : collection of str
        The words that there are.

    Raises
    ------
    RuntimeError
        If one is missing, or one too many.
    """
    missing = [word for word in declared if word not in known]
    extra = [word for word in known if word not in declared]
    if missing or extra:
        found = "; ".join(f"{kind} {', '.join(words)}" for kind, words in (("lacks", missing), ("has", extra)) if words)
        raise RuntimeError(f"{what}: {found}; expected exactly what is declared: {', '.join(declared)}")


def words_of(table: Any, key: str) -> tuple[str, ...]:
    """Return the words that a key of a configuration table may have.

    Parameters
    ----------
    table : type
        The table, a dataclass.
    key : str
        A key whose type is a `Literal`.
    """
    return get_args(get_type_hints(table)[key])


def number_of(word: str, declared: Sequence[str], key: str) -> int:
    """Return the number of a word, its place among those that are declared [1].

    Parameters
    ----------
    word : str
        The word.
    declared : sequence of str
        All of them.
    key : str
        Where it stands, such as ``[physics] hold``.

    Raises
    ------
    ConfigError
        If it is none of them.
    """
    if word not in declared:
        raise ConfigError(f'{key}: found "{word}", expected one of {", ".join(declared)}')
    return declared.index(word)
