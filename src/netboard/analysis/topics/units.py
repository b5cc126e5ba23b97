"""Display units: delays in ms, shares in %, distances in mm. Results themselves are in SI units.

The report, the figures and the terminal all take their units from here.
"""

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """A display unit: the factor from the SI unit, and the largest useful number of decimals."""

    symbol: str
    scale: float = 1.0
    finest: int = 6

    @property
    def in_brackets(self) -> str:
        """The unit as in an axis label or a column heading."""
        return f"[{self.symbol or '1'}]"


MS, PERCENT, POINTS = Unit("ms", 1e3, 1), Unit("%", 1e2), Unit("% points", 1e2)

READ_IN = {
    "m": Unit("mm", 1e3, 1),
    "m/s": Unit("mm/s", 1e3, 1),
    "m2": Unit("mm²", 1e6, 0),
    "m2/s": Unit("mm²/s", 1e6, 0),
    "m2/s2": Unit("mm²/s²", 1e6, 0),
    "m4/s2": Unit("cm⁴/s²", 1e8),
    "J": Unit("mJ", 1e3),
    "W": Unit("mW", 1e3),
}
"""Display units of SI units that are never shown as such."""

_SHORT = re.compile(r"\b(delay|lag|reaction)\b")
_SHARE = re.compile(r"\bshare\b|^falls per attempt")
_DIFFERENCE = re.compile(r": difference|^change of ")
_THE_MEASURE_ITSELF = re.compile(r"(difference\b.*)?")
_RAISED = {"2": "²", "3": "³", "4": "⁴"}


def read_in(unit: str, quantity: str = "", group: str = "") -> Unit:
    """Return the display unit of a quantity in an SI unit, such as ``m2/s``; ``1`` or empty for a pure number.

    The quantity distinguishes delays from completion times, and shares from other pure numbers; differences of shares,
    as their group shows, are in percentage points.
    """
    if unit == "s" and _SHORT.search(quantity):
        return MS
    if unit == "1" and _SHARE.search(quantity) and _THE_MEASURE_ITSELF.fullmatch(quantity.partition(": ")[2]):
        differs = " vs " in group or _DIFFERENCE.search(quantity)
        return POINTS if differs else PERCENT
    if unit in READ_IN:
        return READ_IN[unit]
    return Unit("" if unit == "1" else re.sub(r"(?<=[A-Za-z])[234]", lambda power: _RAISED[power[0]], unit))
