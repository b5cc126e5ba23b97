"""Experimental factors: their declaration in a study, and their level in a recorded block or trial.

A factor is numeric if each level sets the same key to a number or declares a ``value``, boolean if all set the same key
to true or false, and otherwise categorical. A recording carries the declaration of all factors of its block (table
``[design]``). Older recordings without this table have the kind of block and the levels in the block's label.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from math import isnan, nan
from typing import Any, Literal

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.settings import tables
from netboard.base.tables.experiment import Design, FactorType, Role
from netboard.task.studies.parts import CHANGED, Factor

KIND = "kind"
"""Name of the factor for the kind of block."""

Scope = Literal["dyad", "block", "trial"]
"""Unit within which a factor has one level: all blocks of a dyad, a block, or a trial."""

TrialRole = Literal["practice", "familiarisation", "baseline", "test", "catch"]
"""Role of a trial."""

_ROLES: tuple[tuple[str, Role], ...] = (
    ("practice", "practice"),
    ("training", "practice"),
    ("familiari", "familiarisation"),
    ("baseline", "baseline"),
)
"""Roles of kinds of blocks by the beginning of their name."""


@dataclass(frozen=True, slots=True)
class Declared:
    """Declaration of a factor: type, levels, values and unit."""

    type: FactorType
    levels: tuple[str, ...]
    values: tuple[float, ...] = ()  # value of each level of a numeric factor; empty for others
    unit: str = ""


def declared(factor: Factor) -> Declared:
    """Return the declaration of a study's factor."""
    key, found = _only_key(factor)
    given = [level.value for level in factor.levels.values()]
    values = [one if isinstance(one, float) else _number(value) for one, value in zip(given, found, strict=True)]
    levels = tuple(factor.levels)
    kind = factor.type
    if kind == "auto":
        kind = "categorical"
        if found and all(isinstance(one, bool) for one in found):
            kind = "boolean"
        elif values and not any(map(isnan, values)):
            kind = "numeric"
    if kind != "numeric":
        return Declared(kind, levels)
    lacking = [level for level, value in zip(levels, values, strict=True) if isnan(value)]
    if lacking:
        raise ConfigError(f"levels.{lacking[0]} value: there is none, expected one for each level of a numeric factor")
    unit = factor.unit or (key_units().get(key, "") if all(one == "auto" for one in given) else "")
    return Declared("numeric", levels, tuple(values), unit or "1")


def _only_key(factor: Factor) -> tuple[str, list[Any]]:
    """Return the only key that the levels set, with its value at each level; an empty key if there is no such key."""
    set_by = [
        {f"{table}.{key}": value for table, keys in level.changed().items() for key, value in keys.items()}
        for level in factor.levels.values()
    ]
    keys = {key for one in set_by for key in one}
    if len(keys) != 1 or not all(set_by):
        return "", [None] * len(set_by)
    (key,) = keys
    return key, [one[key] for one in set_by]


def _number(value: object) -> float:
    """Return a number as float; NaN for anything else."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else nan


@cache
def key_units() -> dict[str, str]:
    """Return the unit of each key that a study may change, by ``table.key``."""
    return {f"{name}.{key.name}": key.unit for name, of in CHANGED.items() for one in tables(of) for key in one.keys}


# --- recorded blocks ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BlockFactor:
    """A factor in one block."""

    name: str
    scope: Scope
    of: Declared
    sequence: tuple[str, ...]  # the level of the block; for a trial factor, those of its trials, repeated cyclically

    def level(self, trial: int = 1) -> str:
        """Return the level in a trial."""
        return self.sequence[(max(trial, 1) - 1) % len(self.sequence)]

    def value(self, trial: int = 1) -> float:
        """Return the value of the level in a trial; NaN if the factor is not numeric [its unit]."""
        return self.of.values[self.of.levels.index(self.level(trial))] if self.of.values else nan

    @property
    def summary(self) -> str:
        """All levels of the factor in this block, with value and unit."""
        return ", ".join(level_text(self.of, level) for level in dict.fromkeys(self.sequence))

    def text(self, trial: int = 1) -> str:
        """Return name and level, with value and unit if any, such as ``mass heavy (0.05 kg)``."""
        return f"{self.name} {level_text(self.of, self.level(trial))}"


def level_text(of: Declared, level: str) -> str:
    """Format a level, with value and unit if it has them."""
    if not of.values or level not in of.levels:
        return level
    unit = "" if of.unit in ("", "1") else f" {of.unit}"
    return f"{level} ({of.values[of.levels.index(level)]:g}{unit})"


def factors_of(config: Config) -> tuple[BlockFactor, ...]:
    """List the factors of a block with its levels, in the study's order, trial factors last; none without a study."""
    return tuple(_factors(design_of(config)))


def design_of(config: Config) -> Design:
    """Return the design of a block; for older recordings, derive it from the block's label."""
    design, block = config.design, config.block
    if design != Design(role=design.role) or not config.session.study or not block.label:
        return design
    kind, *levels = block.label.split(", ")
    pairs = [pair for one in levels if len(pair := one.split(" ")) == 2]
    return Design(kind=kind.removesuffix(f" {block.performer}"), role=design.role, factors=dict(pairs))


def _factors(design: Design) -> Iterator[BlockFactor]:
    for name, level in design.factors.items():
        scope: Scope = "dyad" if name in design.between else "block"
        yield BlockFactor(name, scope, _declared(design, name, (level,)), (level,))
    for name, levels in design.trials.items():
        yield BlockFactor(name, "trial", _declared(design, name, levels), levels)


def _declared(design: Design, name: str, found: Sequence[str]) -> Declared:
    return Declared(
        design.types.get(name, "categorical"),
        design.levels.get(name, tuple(dict.fromkeys(found))),
        design.values.get(name, ()),
        design.units.get(name, ""),
    )


def role_of(config: Config) -> Role:
    """Return the role of the trials of a block, except catch trials."""
    design = design_of(config)
    return role_by_name(design.kind or config.block.label) if design.role == "auto" else design.role


def role_by_name(name: str) -> Role:
    """Return the role of a block without a declared role, from the name of its kind."""
    plain = name.casefold()
    return next((role for beginning, role in _ROLES if plain.startswith(beginning)), "test")


def trial_role(config: Config, trial: int) -> TrialRole:
    """Return the role of a trial."""
    return "catch" if trial in config.block.catch else role_of(config)


def merge(found: Sequence[BlockFactor]) -> tuple[Scope, Declared]:
    """Merge the declarations of a factor from all blocks that have it; contradictory ones make it categorical."""
    levels = tuple(dict.fromkeys(level for one in found for level in one.of.levels))
    first, kinds = found[0].of, {(one.of.type, one.of.unit) for one in found}
    pairs = {pair for one in found for pair in zip(one.of.levels, one.of.values, strict=False)}
    scope: Scope = "trial" if any(one.scope == "trial" for one in found) else found[0].scope
    if len(kinds) > 1 or (pairs and len(pairs) != len(levels)):
        return scope, Declared("categorical", levels)
    values = dict(pairs)
    return scope, Declared(first.type, levels, tuple(values[level] for level in levels) if values else (), first.unit)


def column_of(name: str) -> str:
    """Return the column name of a factor in tables and exports; the column of its values adds ``_value``."""
    return f"factor_{re.sub('[^A-Za-z0-9_]', '_', name)}"


class TrialDetails:
    """Role and factors of a trial, as the details of its events."""

    def __init__(self, config: Config) -> None:
        self._factors = factors_of(config)
        self._role, self._catch = role_of(config), frozenset(config.block.catch)
        self._has_design = bool(self._factors or self._catch or self._role != "test" or config.design.kind)

    def of(self, trial: int) -> dict[str, str]:
        """Return the ``role`` of a trial and, per factor, column name and level; empty in a block without a design."""
        if not self._has_design:
            return {}
        role = "catch" if trial in self._catch else self._role
        return {"role": role} | {column_of(one.name): level_text(one.of, one.level(trial)) for one in self._factors}
