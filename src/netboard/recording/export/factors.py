"""Factors of the exported recordings: their columns, and the values of these in each trial."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

from netboard.base.config import Config
from netboard.recording.format.channels import Field
from netboard.task.studies.factors import (
    BlockFactor,
    Declared,
    Scope,
    column_of,
    design_of,
    factors_of,
    level_text,
    merge,
    role_of,
)

_WHERE = {"dyad": "one for all blocks of a dyad", "block": "one for a block", "trial": "one for each trial"}


def fields_of(name: str, scope: Scope, of: Declared) -> tuple[Field, ...]:
    """Describe the columns of a factor: its level, and for a numeric factor the value."""
    levels = ", ".join(level_text(of, level) for level in of.levels)
    text = f"level of the factor {name}, {_WHERE[scope]}: {levels}; empty where there is none"
    level = Field(column_of(name), "string", text, "")
    if not of.values:
        return (level,)
    return level, Field(f"{column_of(name)}_value", "number", f"value of this level of {name}", of.unit or "1")


@dataclass(frozen=True, slots=True)
class ExportedFactor:
    """A factor of the recordings in one export."""

    name: str
    scope: Scope
    of: Declared

    @property
    def fields(self) -> tuple[Field, ...]:
        """Columns of the factor."""
        return fields_of(self.name, self.scope, self.of)

    def at(self, factors: Sequence[BlockFactor], trial: int) -> dict[str, Any]:
        """Return the level in a trial, empty for none, and the value of a numeric factor, NaN for none [its unit]."""
        factor = next((one for one in factors if one.name == self.name), None)
        columns: dict[str, Any] = {column_of(self.name): factor.level(trial) if factor else ""}
        if self.of.values:
            columns[f"{column_of(self.name)}_value"] = factor.value(trial) if factor else nan
        return columns

    def over(self, factors: Sequence[BlockFactor]) -> dict[str, Any]:
        """Return the values of the columns in a block; a factor that varies in it has all levels, comma-separated."""
        levels = list(dict.fromkeys(level for one in factors if one.name == self.name for level in one.sequence))
        if len(levels) < 2:
            return self.at(factors, 1)
        return self.at((), 1) | {column_of(self.name): ", ".join(levels)}


def exported_factors(configs: Sequence[Config]) -> tuple[ExportedFactor, ...]:
    """Return the factors of the recordings: each factor with all its levels, in the order of the study."""
    found = [one for config in configs for one in factors_of(config)]
    names = dict.fromkeys(one.name for one in found)
    return tuple(ExportedFactor(name, *merge([one for one in found if one.name == name])) for name in names)


def design_note(config: Config) -> dict[str, str]:
    """Return role, kind if there is one, and the column of each factor with its levels in the block, as text."""
    note = {"role": role_of(config)} | ({"kind": kind} if (kind := design_of(config).kind) else {})
    return note | {column_of(one.name): one.summary for one in factors_of(config)}
