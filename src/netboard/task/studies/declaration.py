"""The declared contrast of a study: its text, and whether the design of the study can estimate it.

A contrast compares two levels of each of one or two factors, the first minus the second: ``haptics: on vs off`` is an
effect, and ``haptics: on vs off x kind: dyadic vs bimanual`` both main effects and their interaction. The factor
``kind`` is the kind of block. A factor of two levels needs no levels in the text: its first level minus its second.
"""

import difflib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

from netboard.base.errors import ConfigError
from netboard.base.tables.outcomes import MODELLED, OUTCOMES, Declaration
from netboard.task.studies.factors import KIND, role_by_name
from netboard.task.studies.order import steps_of

if TYPE_CHECKING:
    from netboard.task.studies.study import Study

MOST = 2
"""Most factors of a contrast [1]."""

_PART = re.compile(r"([A-Za-z][\w-]*)(?:\s*:\s*([\w-]+)\s+vs\s+([\w-]+))?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Compared:
    """A factor of a contrast and its two compared levels, first minus second; no levels where the text has none."""

    factor: str
    levels: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The factor as it is written in a contrast."""
        return f"{self.factor}: {' vs '.join(self.levels)}" if self.levels else self.factor


def contrast_of(text: str) -> tuple[Compared, ...]:
    """Parse a contrast; raises a `ConfigError` that says what was expected."""
    parts = []
    for word in re.split(r"\s+x\s+", text.strip()):
        match = _PART.fullmatch(word)
        if match is None:
            raise ConfigError(f'found "{word}", expected a factor, such as "haptics" or "force: full vs none"')
        parts.append(Compared(match[1], (match[2], match[3]) if match[2] else ()))
    if len(parts) > MOST or len({one.factor for one in parts}) < len(parts):
        raise ConfigError(f'found "{text}", expected one factor, or two different ones, such as "haptics x kind"')
    return tuple(parts)


def compared_levels(part: Compared, levels: Sequence[str]) -> tuple[str, str]:
    """Return the two levels of a part, given all levels of its factor; raises a `ConfigError` if they are not clear."""
    chosen = part.levels or tuple(levels)
    if len(chosen) != 2:
        raise ConfigError(
            f'found "{part.factor}", which has {len(levels)} levels, expected two of them, such as '
            f'"{part.factor}: {" vs ".join((*levels, "another")[:2])}"'
        )
    for level in chosen:
        if level not in levels:
            raise ConfigError(f'found level "{level}" of {part.factor}, {expected(level, levels)}')
    if chosen[0] == chosen[1]:
        raise ConfigError(f'found "{part.text}", expected two different levels')
    return chosen[0], chosen[1]


def expected(name: str, names: Iterable[str]) -> str:
    """List the valid names, and suggest the one that was probably meant."""
    names = list(names)
    near = difflib.get_close_matches(name, names, 1) or difflib.get_close_matches(name.replace("_", " "), names, 1)
    return f"expected one of {', '.join(names) or 'none'}" + (f"; did you mean {near[0]}?" if near else "")


def declaration_text(found: Declaration) -> str:
    """Return a declaration as JSON, for tables; empty if it declares nothing."""
    return "" if found == Declaration() else json.dumps(asdict(found), ensure_ascii=False)


def read_declaration(text: str) -> Declaration:
    """Return the declaration of such a text."""
    values = json.loads(text or "{}")
    return Declaration(**values | {"secondary": tuple(values.get("secondary", ()))})


# --- in a study --------------------------------------------------------------------------------------------------


def declaration_of(study: "Study") -> Declaration:
    """Return the declaration of a valid study with both levels of every factor, as recordings carry it."""
    found = study.analysis
    if not found.primary:
        return found
    parts = contrast_of(found.contrast)
    full = [replace(one, levels=compared_levels(one, levels_of(study, one.factor))) for one in parts]
    return replace(found, contrast=" x ".join(one.text for one in full))


def levels_of(study: "Study", factor: str) -> tuple[str, ...]:
    """Return the levels of a factor of a study; raises a `ConfigError` if it has no such factor."""
    if factor in study.factors:
        return tuple(study.factors[factor].levels)
    if factor == KIND:
        return tuple(name for name in study.kinds if _tested(study, name))
    raise ConfigError(f'found "{factor}", {expected(factor, (*study.factors, KIND))}')


def _tested(study: "Study", kind: str) -> bool:
    """Return whether the trials of a kind of block are test trials."""
    role = study.kinds[kind].role
    return (role_by_name(kind) if role == "auto" else role) == "test"


def declaration_problems(study: "Study") -> Iterator[str]:
    """Find what is wrong in the declaration of a study that is valid otherwise."""
    found = study.analysis
    yield from _outcome_problems(found)
    if not found.primary:
        for key in ("contrast", "secondary"):
            if getattr(found, key):
                yield f"[analysis] {key}: found one without a primary outcome, expected primary, too"
        return
    if not found.contrast:
        yield f"[analysis] contrast: found none, {expected('', (*study.factors, KIND))}, or two of them, as A x B"
        return
    try:
        yield from (f"[analysis] {problem}" for problem in _contrast_problems(study, contrast_of(found.contrast)))
    except ConfigError as error:
        yield f"[analysis] contrast: {error}"


def _outcome_problems(found: Declaration) -> Iterator[str]:
    """Find unknown or repeated outcomes, and outcomes without a model."""
    named = [("primary", found.primary)] * bool(found.primary) + [("secondary", one) for one in found.secondary]
    for key, outcome in named:
        if outcome not in OUTCOMES:
            yield f'[analysis] {key}: found "{outcome}", {expected(outcome, OUTCOMES)}'
        elif found.method == "model" and outcome not in MODELLED:
            yield f'[analysis] method: found "model", expected "t" or "permutation": no model of {outcome}'
    outcomes = [outcome for _, outcome in named]
    for outcome in dict.fromkeys(one for one in outcomes if outcomes.count(one) > 1):
        yield f'[analysis] secondary: found "{outcome}" twice, expected each outcome once'


def _contrast_problems(study: "Study", parts: Sequence[Compared]) -> Iterator[str]:
    """Find reasons why the design cannot estimate a contrast."""
    wanted = {one.factor: compared_levels(one, levels_of(study, one.factor)) for one in parts}
    between = [name for name in wanted if name in study.factors and study.factors[name].order == "between"]
    if between and study.analysis.method == "permutation":
        yield f'method: found "permutation", expected "t" or "model": {between[0]} varies between dyads'
    for order in study.taken():
        cells = cells_of(study, order)
        found = {levels: _others(cells, dict(zip(wanted, levels, strict=True))) for levels in product(*wanted.values())}
        lacking = [levels for levels, others in found.items() if not others]
        if lacking:
            what = ", ".join(f"{name} {level}" for name, level in zip(wanted, lacking[0], strict=True))
            yield f"contrast: cannot be estimated: no test block of order {order} has {what}"
        elif not set.intersection(*found.values()):
            what = " x ".join(wanted)
            yield f"contrast: cannot be estimated: in order {order} the levels of {what} differ in other factors, too"


def cells_of(study: "Study", order: str) -> list[dict[str, str]]:
    """Return the conditions that an order has in test blocks: the level of each factor, and the kind of block."""
    kinds = dict.fromkeys(step.kind for session in steps_of(study.orders[order]) for step in session)
    cells = []
    for kind in kinds:
        if _tested(study, kind):
            factors = study.factors_of(kind) | study.trial_factors_of(kind)
            every = product(*(factor.levels for factor in factors.values()))
            cells += [{KIND: kind, **dict(zip(factors, levels, strict=True))} for levels in every]
    return cells


def _others(cells: Sequence[Mapping[str, str]], wanted: Mapping[str, str]) -> set[frozenset[tuple[str, str]]]:
    """Return the levels of all other factors with which wanted levels occur."""
    return {
        frozenset((name, level) for name, level in cell.items() if name not in wanted)
        for cell in cells
        if all(cell.get(name) == level for name, level in wanted.items())
    }
