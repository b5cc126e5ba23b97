"""Cells of a table as numbers, by the rules of `netboard.base.number`, thousands at a time.

In a ``measured`` table a cell may be empty or NaN: a missing number is NaN, a missing whole number 0; and some programs
write whole numbers with a point, as ``3.0``. In a ``complete`` one, none is missing. In a table as netboard
``exported`` it no cell is empty, a whole number has digits only, and a number may be infinite.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from netboard.base.number import number_of, whole_of

Rule = Literal["measured", "complete", "exported"]

_SPACE = " \t"
_MISSING = ("", "nan")
_WORDS = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}
"""Numbers that netboard exports as words."""

_DIGITS = b"0123456789+-"
_PLAIN: dict[Rule, bytes] = {
    "measured": _DIGITS + b".eE nNaA",
    "complete": _DIGITS + b".eE ",
    "exported": _DIGITS + b".enaif",
}
"""Characters of cells of which Python's own reader, which is faster, takes what ours takes."""

_PLAIN_LINE = b"0123456789+-.eE \r\n"
"""Characters of lines of which NumPy's reader, which is faster still, takes what ours takes of `complete` cells."""

_MOST_WHOLE = 2.0**53
"""Largest float of which every smaller whole number is exact [1]."""


class WrongCell(Exception):
    """A cell that is no number; ``place``: its index."""

    def __init__(self, place: int) -> None:
        super().__init__(place)
        self.place = place


def plain_rows(lines: Sequence[str], separator: str) -> NDArray[np.float64] | None:
    """Return lines of a table as rows of finite numbers; None if a cell may be none, or if rows differ in length."""
    if not _consist_of(lines, _PLAIN_LINE + separator.encode()):
        return None
    with suppress(ValueError):
        found = np.loadtxt(lines, np.float64, comments=None, delimiter=separator, ndmin=2)
        if np.isfinite(found).all():
            return found
    return None


def numbers_in(cells: Sequence[Any] | NDArray[Any], rule: Rule) -> NDArray[np.float64]:
    """Return cells as numbers; raise `WrongCell` at the first that is none."""
    if isinstance(cells, np.ndarray):
        return _allowed(cells.astype(np.float64, copy=False), rule)
    if _consist_of(cells, _PLAIN[rule]):
        with suppress(ValueError):
            whole = [float(cell or "nan") for cell in cells] if rule == "measured" else list(map(float, cells))
            found = np.array(whole, np.float64)
            if not np.isinf(found).any():
                return found
    return _allowed(np.array(_each(cells, _exported_number if rule == "exported" else _number), np.float64), rule)


def whole_numbers_in(cells: Sequence[Any] | NDArray[Any], rule: Rule) -> NDArray[np.int64]:
    """Return cells as whole numbers; raise `WrongCell` at the first that is none."""
    if isinstance(cells, np.ndarray):
        return _whole_floats(cells, rule) if cells.dtype.kind == "f" else cells.astype(np.int64)
    if _consist_of(cells, _DIGITS):
        with suppress(ValueError, OverflowError):
            whole = [int(cell or "0") for cell in cells] if rule == "measured" else list(map(int, cells))
            return np.array(whole, np.int64)
    return np.array(_each(cells, _exported_whole if rule == "exported" else _whole), np.int64)


def _allowed(values: NDArray[np.float64], rule: Rule) -> NDArray[np.float64]:
    """Refuse infinite and missing numbers where there can be none."""
    wrong = np.isinf(values) if rule == "measured" else ~np.isfinite(values) & (rule == "complete")
    if wrong.any():
        raise WrongCell(int(np.argmax(wrong)))
    return values


def _whole_floats(values: NDArray[np.floating[Any]], rule: Rule) -> NDArray[np.int64]:
    """Convert floats of a Parquet file."""
    missing = np.isnan(values)
    whole = (np.abs(values) < _MOST_WHOLE) & (values == np.round(values))
    wrong = ~whole & ~(missing & (rule == "measured"))
    if wrong.any():
        raise WrongCell(int(np.argmax(wrong)))
    return np.where(missing, 0, values).astype(np.int64)


def _consist_of(cells: Sequence[Any], characters: bytes) -> bool:
    """Return whether all cells are text of these characters only."""
    try:
        return not "".join(cells).encode("ascii").translate(None, characters)
    except (TypeError, UnicodeEncodeError):
        return False


def _each(cells: Sequence[Any], read: Callable[[Any], float]) -> list[float]:
    """Read cell by cell."""
    found = []
    for place, cell in enumerate(cells):
        try:
            found.append(read(cell.strip(_SPACE) if isinstance(cell, str) else cell))
        except (TypeError, ValueError):
            raise WrongCell(place) from None
    return found


def _exported_number(cell: Any) -> float:
    return _WORDS[cell] if cell in _WORDS else number_of(cell)


def _number(cell: Any) -> float:
    """Read a cell of text, or of a Parquet column in which some are missing."""
    if _is_missing(cell):
        return float("nan")
    if isinstance(cell, str):
        return number_of(cell)
    if isinstance(cell, bool):
        raise TypeError
    return float(cell)


def _exported_whole(cell: Any) -> int:
    return _in_64_bits(cell if isinstance(cell, int) else whole_of(cell))


def _whole(cell: object) -> int:
    """Read a cell as `_number`; text may end in ``.0``."""
    if isinstance(cell, int) and not isinstance(cell, bool):
        return _in_64_bits(cell)
    if _is_missing(cell):
        return 0
    if not isinstance(cell, str):
        return int(_whole_floats(np.array([_number(cell)]), "measured")[0])
    digits, _, zeros = cell.partition(".")
    if zeros.strip("0"):
        raise ValueError
    return _in_64_bits(whole_of(digits))


def _is_missing(cell: object) -> bool:
    return cell is None or (isinstance(cell, str) and cell.lower() in _MISSING)


def _in_64_bits(value: int) -> int:
    if not -(2**63) <= value < 2**63:
        raise ValueError
    return value
