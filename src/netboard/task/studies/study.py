"""Read, check and write study files: kinds of blocks, factors, and the order of blocks.

A study file is TOML. It changes keys of the rig's configuration by table and key (``block.trials = 60``,
``physics.M = 0.02``): for all blocks at the top of the file, for a kind of block in ``[kinds.NAME]``, for a level of a
factor in ``[factors.NAME.levels.LEVEL]``. A level overrides a kind, and a kind overrides the top. An invalid file
raises a `ConfigError` with one line per problem.

This module has no dyads: `netboard.task.plans.plan` makes the blocks of a dyad from a study.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import combinations
from typing import Annotated, Any, TypeVar

from netboard.base.errors import ConfigError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, TextForm, about, check, parse_toml, to_toml
from netboard.base.tables.outcomes import Declaration
from netboard.base.tables.questionnaires import RESERVED, SHIPPED, FormQuestion, flaws, flaws_of_form
from netboard.task.studies import library
from netboard.task.studies.declaration import declaration_problems, expected
from netboard.task.studies.factors import declared
from netboard.task.studies.order import MOST, steps_of
from netboard.task.studies.parts import (
    ALL,
    CHANGED,
    PLANNED,
    SESSION,
    WITHIN,
    Changes,
    Factor,
    Kind,
    Level,
    Questionnaire,
)

T = TypeVar("T")

IN_TRIALS = "block.force_scale"
"""The only key that may vary from trial to trial within a block."""

NAME = TextForm("^[A-Za-z][A-Za-z0-9_-]*$", "of letters, digits, - and _, beginning with a letter, such as pilot2")
"""Form of the name of a study."""

_LATER: dict[type[Any], dict[str, Any]] = {
    Level: {"value": "auto", "other_hand": ""},
    Factor: {"type": "auto", "unit": ""},
    Kind: {"role": "auto", "perturbed": 0.0, "perturbed_after": 1, "perturbed_both_ways": False},
    Questionnaire: {"form": "", "wait": 120.0},
}
"""Keys added in later versions, with their defaults, by part."""


@dataclass(frozen=True, slots=True)
class Study(Changes):
    """A study; its own changes apply to all its blocks."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    name: Annotated[str, about("name of the study", form=NAME)] = "study"
    text: Annotated[str, about("description, in one sentence")] = ""
    order: Annotated[
        tuple[str, ...], about("names of orders that dyads take in turn; none: the first of [orders]", strict=False)
    ] = ()
    trials_per_condition: Annotated[
        int, about("trials of each participant in each kind and condition; 0: any number", "1", ge=0, le=1_000_000)
    ] = 0
    long_rest: Annotated[float, about("rest where an order has a /", "s", ge=0, le=3600)] = 300.0
    orders: Annotated[dict[str, str], about("orders of blocks by name")] = field(default_factory=dict)
    factors: Annotated[dict[str, Factor], about("factors, by name")] = field(default_factory=dict)
    kinds: Annotated[dict[str, Kind], about("kinds of blocks, by name")] = field(default_factory=dict)
    questionnaires: Annotated[dict[str, Questionnaire], about("questionnaires, by name")] = field(default_factory=dict)
    analysis: Annotated[Declaration, about("question, primary outcome and contrast")] = field(
        default_factory=Declaration
    )

    def taken(self) -> tuple[str, ...]:
        """Return the names of the orders that dyads take in turn."""
        return self.order or tuple(self.orders)[:1]

    def factors_of(self, kind: str) -> dict[str, Factor]:
        """Return the factors that vary over a kind's blocks, slowest first."""
        return {name: factor for name, factor in self._every(kind).items() if factor.order != WITHIN}

    def trial_factors_of(self, kind: str) -> dict[str, Factor]:
        """Return the factors that vary over the trials of a kind's blocks."""
        return {name: factor for name, factor in self._every(kind).items() if factor.order == WITHIN}

    def _every(self, kind: str) -> dict[str, Factor]:
        names = self.kinds[kind].factors
        return {name: factor for name, factor in self.factors.items() if name in names or ALL in names}


# --- reading -----------------------------------------------------------------------------------------------------


def parse_study(text: str, source: str = "study.toml") -> Study:
    """Parse and check a study file.

    Raises `ConfigError` if the text is not TOML, a key is unknown, of the wrong type or out of range, or parts
    contradict each other. The message has one line per problem.
    """
    values = parse_toml(text, source)
    problems: list[str] = []
    study = _whole(values, problems)
    if study is not None and not problems:
        problems += _contradictions(study)
    if study is not None and not problems:
        problems += declaration_problems(study)
    if study is None or problems:
        raise ConfigError("\n".join(f"{source}: {problem}" for problem in dict.fromkeys(problems)))
    return study


def paper_study() -> Study:
    """Return the study of the paper, with 18 blocks of 60 trials, from its built-in file."""
    return parse_study(library.text_of("paper"), "paper")


def _whole(values: dict[str, Any], problems: list[str]) -> Study | None:
    """Check all tables, the inner ones first."""
    values = dict(values)
    for name, factor in _tables(values, "factors", (), problems):
        path = ("factors", name)
        for level, changes in _tables(factor, "levels", path, problems):
            _put(factor["levels"], level, _changes(Level, changes, (*path, "levels", level), problems))
        _put(values["factors"], name, _checked(Factor, factor, path, problems))
    for name, kind in _tables(values, "kinds", (), problems):
        _put(values["kinds"], name, _changes(Kind, kind, ("kinds", name), problems))
    for name, questionnaire in _tables(values, "questionnaires", (), problems):
        path = ("questionnaires", name)
        for label, question in _tables(questionnaire, "questions", path, problems):
            where = (*path, "questions", label)
            _put(questionnaire["questions"], label, _checked(FormQuestion, {"text": "", **question}, where, problems))
        _put(values["questionnaires"], name, _checked(Questionnaire, questionnaire, path, problems))
    for name in _table(values, "orders", (), problems):
        _name(name, ("orders", name), problems)
    if "analysis" in values:
        declared_analysis = _table(values, "analysis", (), problems)
        _put(values, "analysis", _checked(Declaration, declared_analysis, ("analysis",), problems))
    return _changes(Study, values, (), problems)


def _put(table: dict[str, Any], name: str, value: object) -> None:
    """Replace a table by its checked value, or remove it if invalid: its problem is already listed."""
    if value is None:
        del table[name]
    else:
        table[name] = value


def _table(values: dict[str, Any], name: str, path: Sequence[str], problems: list[str]) -> dict[str, Any]:
    """Return a copy of the table of that name; a value that is no table is a problem and gives an empty one."""
    found = values.get(name, {})
    if not isinstance(found, dict):
        problems.append(f"[{'.'.join((*path, name))}]: found {_found(found)}, expected a table")
        found = {}
    table: dict[str, Any] = dict(found)
    if name in values:
        values[name] = table
    return table


def _tables(
    values: dict[str, Any], name: str, path: Sequence[str], problems: list[str]
) -> list[tuple[str, dict[str, Any]]]:
    """Return copies of the tables within the table of that name."""
    table = _table(values, name, path, problems)
    inner = []
    for key in list(table):
        _name(key, (*path, name, key), problems)
        inner.append((key, _table(table, key, (*path, name), problems)))
    return inner


def _name(name: str, path: Sequence[str], problems: list[str]) -> None:
    """Add a problem if a name is not valid in an order and in a file name."""
    if not name.replace("_", "").replace("-", "").isalnum() or not name.isascii() or not name[0].isalpha():
        problems.append(f"[{'.'.join(path)}]: expected a name of letters, digits, _ and -, with a letter first")


def _checked(cls: type[T], values: dict[str, Any], path: Sequence[str], problems: list[str]) -> T | None:
    """Check one table; return None if it is invalid."""
    try:
        return check(cls, values, tuple(path))
    except ConfigError as error:
        problems += str(error).splitlines()
        return None


def _changes(cls: type[T], values: dict[str, Any], path: Sequence[str], problems: list[str]) -> T | None:
    """Check a table with changes of the configuration."""
    for table, of in CHANGED.items():
        changed = _table(values, table, path, problems)
        for key in [key for key in changed if key in PLANNED.get(table, ())]:
            del changed[key]
            problems.append(f"[{'.'.join((*path, table))}] {key}: follows from the plan and is not set here")
        checked = _checked(of, changed, (*path, table), problems) if changed else None
        if checked is not None:
            values[table] = {key: getattr(checked, key) for key in changed}
    known = {item.name for item in fields(cls)}  # type: ignore[arg-type]
    for key in [key for key in values if key not in known]:
        homes = [table for table, of in CHANGED.items() if key in {item.name for item in fields(of)}]
        if homes and key not in PLANNED.get(homes[0], ()):
            del values[key]
            where = f"[{'.'.join(path)}] {key}" if path else key
            problems.append(f"{where}: unknown key; did you mean {homes[0]}.{key}?")
    for language in _table(values, "instructions", path, problems):
        _name(language, (*path, "instructions", language), problems)
    return _checked(cls, values, path, problems)


def _found(value: object) -> str:
    """Format an invalid value as it is written in the file."""
    return to_toml(value) if isinstance(value, str | bool | int | float) else f"a {type(value).__name__}"


# --- contradictions ----------------------------------------------------------------------------------------------


def _contradictions(study: Study) -> Iterator[str]:
    """Find parts that are each valid but contradict each other."""
    if not study.kinds:
        yield "[kinds]: found none, expected at least one kind of block, such as [kinds.dyadic]"
    if not study.orders:
        yield '[orders]: found none, expected at least one, such as main = "4 dyadic"'
    for name in study.order:
        if name not in study.orders:
            yield f'order: found "{name}", {expected(name, study.orders)}'
    for name, text in study.orders.items():
        yield from (f"[orders] {name}: {problem}" for problem in _order_problems(study, text))
    for name, factor in study.factors.items():
        if len(factor.levels) < 2:
            yield f"[factors.{name}] levels: found {len(factor.levels)}, expected two or more"
        if name == ALL:
            yield f"[factors.{name}]: expected another name; this one stands for all factors"
        yield from (f"[factors.{name}] {problem}" for problem in _factor_problems(factor))
    for name, questionnaire in study.questionnaires.items():
        for kind in questionnaire.after:
            if kind not in (*study.kinds, SESSION):
                yield f'[questionnaires.{name}] after: found "{kind}", {expected(kind, (*study.kinds, SESSION))}'
        yield from (f"[questionnaires.{name}{problem}" for problem in _questionnaire_problems(name, questionnaire))
    for name in study.kinds:
        yield from (f"[kinds.{name}]{problem}" for problem in _kind_problems(study, name))


def _questionnaire_problems(of: str, questionnaire: Questionnaire) -> Iterator[str]:
    """Find the problems of the questionnaire of a name."""
    if questionnaire.form and questionnaire.form not in SHIPPED:
        yield f'] form: found "{questionnaire.form}", {expected(questionnaire.form, SHIPPED)}'
    if questionnaire.form and questionnaire.questions:
        yield "] form: found one with questions of its own, expected either"
    if not (questionnaire.text or questionnaire.asked()):
        yield "] text: found none, expected a text for the operator, or questions to the participants"
    for name, question in questionnaire.questions.items():
        if name in RESERVED:
            yield f".questions.{name}]: expected another name; this one is a column of exports"
        yield from (f".questions.{name}] {flaw}" for flaw in flaws(question))
    asked = {f"{of}.{name}": question for name, question in questionnaire.asked().items()}
    yield from (f"] questions: {flaw}" for flaw in flaws_of_form(asked))


def _order_problems(study: Study, text: str) -> Iterator[str]:
    """Find the problems of an order."""
    try:
        steps = [step for session in steps_of(text) for step in session]
    except ConfigError as error:
        yield str(error)
        return
    for kind in dict.fromkeys(step.kind for step in steps if step.kind not in study.kinds):
        yield f'found "{kind}", {expected(kind, study.kinds)}'
    blocks = sum(len(study.kinds[step.kind].people()) for step in steps if step.kind in study.kinds)
    if blocks > MOST:
        yield f"{blocks} blocks, expected at most {MOST}"


def _factor_problems(factor: Factor) -> Iterator[str]:
    """Find the problems of a factor."""
    try:
        declared(factor)
    except ConfigError as error:
        yield str(error)
    for level, changes in factor.levels.items() if factor.order == WITHIN else ():
        hand = {"other_hand"} if changes.other_hand else set[str]()
        if set_here := sorted((_keys(changes) | hand) - {IN_TRIALS}):
            yield f"levels.{level}: sets {', '.join(set_here)}; within a block only {IN_TRIALS} can differ"
        if changes.instructions:
            yield f"levels.{level} instructions: found some, expected none for a factor within a block"


def _kind_problems(study: Study, name: str) -> Iterator[str]:
    """Find the problems of a kind of block."""
    kind = study.kinds[name]
    if name == SESSION:
        yield ": expected another name; this one stands for the end of a session"
    for factor in kind.factors:
        if factor not in (*study.factors, ALL):
            yield f' factors: found "{factor}", {expected(factor, (*study.factors, ALL))}'
    varied = study.factors_of(name)
    hands = [kind.other_hand] if kind.other_hand != "own" else []
    hands += [level.other_hand for factor in varied.values() for level in factor.levels.values() if level.other_hand]
    if kind.performers == "dyad" and hands:
        yield f' other_hand: found "{hands[0]}", expected performers = "A", "B", "AB" or "BA" with it'
    deciding = [one for one, factor in varied.items() if any(level.other_hand for level in factor.levels.values())]
    if len(deciding) > 1:
        yield f" factors: {' and '.join(deciding)} both set other_hand, expected at most one of them to"
    every = varied | study.trial_factors_of(name)
    by_factor = {one: set().union(*map(_keys, factor.levels.values())) for one, factor in every.items()}
    for one, other in combinations(every, 2):
        for key in sorted(by_factor[one] & by_factor[other]):
            yield f" factors: {one} and {other} both set {key}, expected at most one of them to"
    anywhere = _keys(study).union(_keys(kind), *by_factor.values())
    if kind.performers != "dyad" and anywhere & {"block.left", "block.right"}:
        yield " block.left, block.right: are set, expected neither where one participant performs (see other_hand)"
    limits = [{**study.block, **kind.block}, *(level.block for f in varied.values() for level in f.levels.values())]
    if study.trials_per_condition and varied and any(block.get("duration", 0) > 0 for block in limits):
        yield " block.duration: with a time limit the number of trials is unknown; expected trials_per_condition = 0"


def _keys(changes: Changes) -> set[str]:
    """Return the keys that a part of the study sets, as ``table.key``."""
    return {f"{table}.{key}" for table, keys in changes.changed().items() for key in keys}


# --- writing -----------------------------------------------------------------------------------------------------


def digest_of_study(study: Study) -> str:
    """Return the SHA-256 of a study in hexadecimal, without its declared analysis, on which no plan depends."""
    return hashlib.sha256(resolve_study(replace(study, analysis=Declaration())).encode()).hexdigest()


def resolve_study(study: Study) -> str:
    """Return a study in full as TOML; `parse_study` gives back an equal study."""
    lines = list(_lines(study))
    for name, text in study.orders.items():
        lines += ["", "[orders]"] if name == next(iter(study.orders)) else []
        lines.append(f"{name} = {to_toml(text)}")
    for name, factor in study.factors.items():
        lines += ["", f"[factors.{name}]", *_lines(factor)]
        for level, changes in factor.levels.items():
            lines += ["", f"[factors.{name}.levels.{level}]", *_lines(changes)]
    for name, kind in study.kinds.items():
        lines += ["", f"[kinds.{name}]", *_lines(kind)]
    for name, questionnaire in study.questionnaires.items():
        lines += ["", f"[questionnaires.{name}]", *_lines(questionnaire)]
        for label, question in questionnaire.questions.items():
            lines += ["", f"[questionnaires.{name}.questions.{label}]", *_lines(question)]
    if study.analysis != Declaration():
        lines += ["", "[analysis]", *_lines(study.analysis)]
    return "\n".join(lines) + "\n"


def _lines(part: Any) -> Iterator[str]:
    """Yield the lines of a part without its subtables: plain keys, and changes as ``table.key``."""
    written, later = (*CHANGED, "instructions"), _LATER.get(type(part), {})
    for item in fields(part):
        value = getattr(part, item.name)
        if item.name in later and value == later[item.name]:
            continue  # keeps the digest of studies written before the key existed
        if isinstance(value, Declaration):
            continue  # a table of its own
        if not isinstance(value, dict):
            yield f"{item.name} = {to_toml(value)}"
        elif item.name in written:
            yield from (f"{item.name}.{key} = {to_toml(inner)}" for key, inner in value.items())
