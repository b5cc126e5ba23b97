"""Warnings of a study that is valid, but whose levels may not differ in what was meant.

A level changes the keys that it names; all other keys stay as the study, the kind of block or the rig's configuration
has them. Two levels that each set a key which the other leaves alone therefore differ in two keys: usually one of them
is misspelt.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

from netboard.base.config import Config
from netboard.base.settings import to_toml
from netboard.task.studies.factors import key_units
from netboard.task.studies.parts import Changes
from netboard.task.studies.study import Study


def warnings_of(study: Study, config: Config) -> tuple[str, ...]:
    """Return a sentence for each two levels of a factor of which each sets a key that the other leaves as it is.

    ``config``: the rig's configuration, from which keys come that nothing in the study sets.
    """
    return tuple(
        f"[factors.{name}] levels: {_said(study, config, name, pair)}"
        for name, factor in study.factors.items()
        for pair in combinations(factor.levels, 2)
        if all(_only(factor.levels[one], factor.levels[other]) for one, other in (pair, pair[::-1]))
    )


def _said(study: Study, config: Config, name: str, pair: tuple[str, str]) -> str:
    """Say which keys two levels set differently, and what each unset one is."""
    levels, (first, second) = study.factors[name].levels, pair
    own = {one: _only(levels[one], levels[other]) for one, other in (pair, pair[::-1])}
    sets = f"{first} sets {', '.join(own[first])}, {second} sets {', '.join(own[second])}"
    kept = [
        f"at {level} {key} stays {_values(study, config, name, key)}"
        for level, other in (pair, pair[::-1])
        for key in own[other]
    ]
    advice = "If one is misspelt, correct it; else set both in both"
    return f"{sets}, and neither sets the other's key: {'; '.join(kept)}. {advice}"


def _only(level: Changes, other: Changes) -> tuple[str, ...]:
    """Return the keys that one level sets and the other does not, as ``table.key``."""
    keys = (dict(_flat(one)) for one in (level, other))
    here, there = keys
    return tuple(key for key in here if key not in there)


def _flat(changes: Changes) -> Iterator[tuple[str, Any]]:
    """Yield the keys that a part of a study sets, as ``table.key``, with their values."""
    for table, keys in changes.changed().items():
        yield from ((f"{table}.{key}", value) for key, value in keys.items())


def _values(study: Study, config: Config, factor: str, key: str) -> str:
    """Return the value of a key that a level does not set, in each kind of block that the factor varies."""
    table, _, name = key.partition(".")
    rig = getattr(getattr(config, table), name)
    of_kind = {
        kind: dict(_flat(changes)).get(key, dict(_flat(study)).get(key, rig))
        for kind, changes in study.kinds.items()
        if factor in {**study.factors_of(kind), **study.trial_factors_of(kind)}
    }
    values: Sequence[Any] = list(dict.fromkeys(of_kind.values())) or [rig]
    unit = key_units().get(key, "")
    unit = f" {unit}" if unit not in ("", "1") else ""
    if len(values) == 1:
        return f"{to_toml(values[0])}{unit}"
    return ", ".join(f"{to_toml(value)}{unit} ({kind})" for kind, value in of_kind.items())
