"""Factors of a study as columns, and the condition of every block and trial.

Every study has three factors: the configuration, the haptic feedback (force) and the partner. Anything else that varies
by plan has its own column: the kind of block, the factors that the study declares, and settings that differ between
blocks without a declared factor. A level that the three do not determine becomes part of the condition's name, so no
two levels are ever pooled unseen. The paper's study needs no further names.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import nan
from typing import Any

import numpy as np
import pandas as pd

from netboard.analysis.extraction.tables import words
from netboard.base.config import Config
from netboard.base.settings import tables
from netboard.base.tables.experiment import STILL
from netboard.base.tables.forces import CONDITIONS
from netboard.participants.seat import partners
from netboard.recording.export.factors import fields_of
from netboard.recording.format.channels import Field
from netboard.task.studies.factors import KIND, BlockFactor, Declared, Scope, column_of, factors_of, level_text, merge

SETTINGS = {"block": ("force_scale", "force_delay_ms"), "physics": (), "task": (), "geometry": ()}
"""Configuration tables, and their keys (empty: all), that may differ without being a declared factor."""

_BASE = ["configuration", "force", "partner"]


@dataclass(frozen=True, slots=True)
class StudyFactor:
    """A factor of a study; `in_names` of conditions if configuration, force and partner do not determine its level."""

    name: str
    scope: Scope
    of: Declared
    in_names: bool = False

    @property
    def column(self) -> str:
        """Name of the column with its levels."""
        return self.name if self.name == KIND else column_of(self.name)

    @property
    def fields(self) -> tuple[Field, ...]:
        """Columns of the factor: the level, and the value of a numeric factor."""
        if self.name == KIND:
            return (words(KIND, "kind of block, as in the study; empty: none"),)
        return fields_of(self.name, self.scope, self.of)

    @property
    def label(self) -> str:
        """Name and unit, such as ``mass [kg]``."""
        return f"{self.name} [{self.of.unit}]" if self.of.values else self.name

    def text(self, level: str) -> str:
        """Label of a level, such as ``mass heavy (0.05 kg)``."""
        return f"{self.name} {level_text(self.of, level)}"


# --- of one recording ----------------------------------------------------------------------------------------------


def factors_text(config: Config) -> str:
    """Return the factors of a recording's block as text, for `study_levels`."""
    return json.dumps([asdict(one) for one in factors_of(config)])


def settings_text(config: Config) -> str:
    """Return the settings that may differ without a declared factor as text, for `study_levels`.

    A gain that no factor varies over the trials is a list with that of each trial.
    """
    found = {
        f"{table}.{key}": getattr(getattr(config, table), key)
        for table, keys in SETTINGS.items()
        for key in keys or getattr(config, table).__slots__
    }
    if config.block.trial_scales and not config.design.trials:
        found["block.force_scale"] = config.block.trial_scales
    return json.dumps(found)


# --- of a study ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class FactorLevels:
    """Level of each factor in each block, by name of the factor, in the order of the table.

    One level stands for a block, or one for each trial; none if the block has none.
    """

    factors: tuple[StudyFactor, ...]
    sequences: Mapping[str, Sequence[tuple[str, ...]]]

    def at(self, factor: StudyFactor, places: Iterable[int], trials: Iterable[int]) -> list[str]:
        """Return the level of a factor in trials, by block index from 0 and number in the block from 1."""
        own = self.sequences[factor.name]
        return [
            own[place][(max(trial, 1) - 1) % len(own[place])] if own[place] else ""
            for place, trial in zip(places, trials, strict=True)
        ]


def study_levels(blocks: pd.DataFrame, analysed: pd.Series) -> FactorLevels:
    """Find the factors of a study, and which of them the names of conditions must include.

    Declared factors come in the order of the study, then the kind of block, then settings that differ: columns
    ``kind``, ``factors``, ``settings`` and ``partner`` of the blocks. Only the blocks that are analysed affect the
    names.
    """
    declared = [tuple(map(_read, json.loads(text or "[]"))) for text in blocks["factors"]]
    names = list(dict.fromkeys(one.name for own in declared for one in own))
    merged = [merge([one for own in declared for one in own if one.name == name]) for name in names]
    factors = [StudyFactor(name, scope, of) for name, (scope, of) in zip(names, merged, strict=True)]
    sequences: dict[str, list[tuple[str, ...]]] = {
        name: [next((one.sequence for one in own if one.name == name), ()) for own in declared] for name in names
    }
    factors.append(
        StudyFactor(KIND, "block", Declared("categorical", tuple(dict.fromkeys(filter(None, blocks[KIND])))))
    )
    sequences[KIND] = [(kind,) if kind else () for kind in blocks[KIND]]
    for factor, own in _undeclared(blocks, sequences, analysed):
        factors.append(factor)
        sequences[factor.name] = own
    cells = [blocks.loc[analysed, name].tolist() for name in _BASE]
    for place, factor in enumerate(factors):
        levels = [sequence for sequence, kept in zip(sequences[factor.name], analysed, strict=True) if kept]
        if not _is_known(cells, levels):
            cells.append(levels)
            factors[place] = replace(factor, in_names=True)
    return FactorLevels(tuple(factors), sequences)


def _read(values: Mapping[str, Any]) -> BlockFactor:
    return BlockFactor(values["name"], values["scope"], _declared(values["of"]), tuple(values["sequence"]))


def factor_read(values: Mapping[str, Any]) -> StudyFactor:
    """Return a factor of a study from its JSON form."""
    name, scope, of, in_names = values.values()  # by position: cohorts of earlier versions have another last key
    return StudyFactor(name, scope, _declared(of), in_names)


def _declared(of: Mapping[str, Any]) -> Declared:
    return Declared(of["type"], tuple(of["levels"]), tuple(of["values"]), of["unit"])


def _is_known(cells: Sequence[Sequence[Any]], own: Sequence[tuple[str, ...]]) -> bool:
    """Return whether the known columns of blocks determine the level of a factor in each of their trials."""
    found: dict[Any, tuple[str, ...]] = {}
    for *known, sequence in zip(*cells, own, strict=True):
        if len(set(sequence)) > 1 or found.setdefault(tuple(known), sequence[:1]) != sequence[:1]:
            return False
    return True


def _undeclared(
    blocks: pd.DataFrame, sequences: Mapping[str, Sequence[tuple[str, ...]]], analysed: pd.Series
) -> Iterator[tuple[StudyFactor, list[tuple[str, ...]]]]:
    """Yield settings that differ between blocks with the same declared levels."""
    settings = [json.loads(text or "{}") for text in blocks["settings"]]
    known = [blocks.loc[analysed, name].tolist() for name in _BASE]
    known += [[one for one, kept in zip(own, analysed, strict=True) if kept] for own in sequences.values()]
    for key in dict.fromkeys(key for one in settings for key in one):
        every = [_listed(one.get(key)) for one in settings]
        own = [tuple(map(_level, values)) for values in every]
        if _is_known(known, [one for one, kept in zip(own, analysed, strict=True) if kept]):
            continue
        values = sorted({one for values in every for one in values}, key=lambda value: (str(type(value)), value))
        levels = tuple(dict.fromkeys(map(_level, values)))
        numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
        of = Declared("categorical", levels)
        if numeric:
            of = Declared("numeric", levels, tuple(map(float, values)), _unit_of(key) or "1")
        yield StudyFactor(key, "trial" if any(len(set(one)) > 1 for one in own) else "block", of), own


def _listed(value: object) -> list[Any]:
    """Return the values of a setting in a block: one, one for each trial, or none if it is not known."""
    return value if isinstance(value, list) else [] if value is None else [value]


def _level(value: object) -> str:
    """Return a value as a short text, with as many digits as tell it from all others."""
    short = f"{value:g}" if isinstance(value, float) else str(value)
    return short if not isinstance(value, float) or float(short) == value else repr(value)


def _unit_of(key: str) -> str:
    table, _, name = key.partition(".")
    return next((one.unit for own in tables(Config) if own.name == table for one in own.keys if one.name == name), "")


STAND_INS = tuple(sorted({STILL, *partners.names()}))
"""Movers of a stylus that are not participants."""


def partner_of(movers: Iterable[str]) -> str:
    """Return the partner if it is neither participant, such as ``robot partner``; otherwise empty."""
    there = set(movers)
    return ", ".join(f"{kind} partner" for kind in STAND_INS if kind in there)


def participants_of(blocks: pd.DataFrame) -> list[str]:
    """Return the pseudonyms of the participants in the blocks of a dyad, sorted."""
    return sorted({*blocks["left_by"], *blocks["right_by"]} - {*STAND_INS, *blocks["dyad"]})


def names_of(base: pd.DataFrame, levels_of: Mapping[str, Sequence[str]], roles: Iterable[str]) -> list[str]:
    """Return names of conditions: configuration, haptics, partner, distinguishing levels, a role other than test."""
    columns = [base[name].tolist() for name in _BASE]
    columns[_BASE.index("force")] = [
        CONDITIONS[force].label if force in CONDITIONS else force for force in base["force"]
    ]
    columns += [[f"{name} {level}" if level else "" for level in levels] for name, levels in levels_of.items()]
    columns.append(["" if role == "test" else role for role in roles])
    return [", ".join(filter(None, row)) for row in zip(*columns, strict=True)]


def value_columns(factor: StudyFactor, levels: Sequence[str]) -> dict[str, Any]:
    """Return the columns of a factor in a table: the level, and the value of a numeric factor [its unit]."""
    columns: dict[str, Any] = {factor.column: np.array(levels, object)}
    if factor.of.values:
        of = dict(zip(factor.of.levels, factor.of.values, strict=True))
        columns[f"{factor.column}_value"] = np.array([of.get(level, nan) for level in levels], np.float64)
    return columns
