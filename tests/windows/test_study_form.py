"""Forms of a study: a field for each declared key of each part, and a text in which one line changes."""

from difflib import ndiff

import pytest

from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Block
from netboard.base.tables.questionnaires import FormQuestion
from netboard.task.studies import library
from netboard.task.studies.parts import CHANGED, Factor, Kind, Level, Questionnaire
from netboard.task.studies.study import parse_study
from netboard.windows.launcher.settings_form import FormField
from netboard.windows.launcher.study_form import (
    OWN,
    Collection,
    changed_study,
    collections_of,
    parts_of,
    with_part,
    without_part,
)

TEXT = """# A study of ours.
name = "ours"
block.trials = 6  # few

[orders]
main = "2 dyadic, 2 bimanual"

[factors.haptics]
levels.on.block.force = "full"
levels.off.block.force = "none"

# Both together.
[kinds.dyadic]
catch = 0.25 # a quarter

[kinds.bimanual]
performers = "AB"

[questionnaires.effort]
after = ["dyadic"]
questions.load = { kind = "vas", text = "How hard was it?" }
"""


def field(part: str, form: str, key: str, text: str = TEXT) -> FormField:
    """Return the field of a key."""
    (found,) = [one for one in parts_of(parse_study(text)) if one.name == part]
    (of_key,) = [one for one in found.fields(form) if one.key.name == key]
    return of_key


def changed(part: str, form: str, key: str, entry: str) -> list[str]:
    """Return the lines that a change of a key removes and adds."""
    made = changed_study(TEXT, field(part, form, key), entry).splitlines()
    before = TEXT.splitlines()
    return [f"-{line}" for line in before if line not in made] + [f"+{line}" for line in made if line not in before]


def test_every_part_has_its_forms() -> None:
    parts = {part.name: part.forms for part in parts_of(parse_study(TEXT))}
    assert list(parts) == [
        *("study", "orders", "analysis", "kinds.dyadic", "kinds.bimanual"),
        *("factors.haptics", "factors.haptics.levels.on", "factors.haptics.levels.off"),
        *("questionnaires.effort", "questionnaires.effort.questions.load"),
    ]
    assert parts["kinds.dyadic"] == parts["study"] == (OWN, *CHANGED)
    assert parts["analysis"] == (OWN,)


@pytest.mark.parametrize("name", library.names())
def test_fields_of_every_built_in_study_show_its_values(name: str) -> None:
    study = parse_study(library.text_of(name))
    for part in parts_of(study):
        for form in part.forms:
            for one in part.fields(form):
                assert one.help, one
    shown = {part.name: part.fields(OWN) for part in parts_of(study)}
    assert {one.key.name: one.text for one in shown["orders"]} == study.orders
    assert [one.text for one in shown["study"] if one.key.name == "name"] == [study.name]


def test_a_field_has_choices_unit_and_help_of_its_declaration() -> None:
    performers = field("kinds.bimanual", OWN, "performers")
    assert performers.choices == ("dyad", "A", "B", "AB", "BA")
    assert (performers.text, performers.usual) == ("AB", False)
    rest = field("kinds.dyadic", "block", "rest")
    assert (rest.unit, rest.text) == ("s", str(Block().rest))
    assert field("factors.haptics.levels.on", OWN, "value").choices == (), "a word or a number"
    assert "number" not in {one.key.name for one in parts_of(parse_study(TEXT))[0].fields("block")}, "the plan sets it"


@pytest.mark.parametrize(
    ("part", "form", "key", "entry", "expected"),
    [
        ("study", OWN, "name", "theirs", ['-name = "ours"', '+name = "theirs"']),
        ("study", OWN, "long_rest", "60", ["+long_rest = 60"]),
        ("study", "block", "trials", "12", ["-block.trials = 6  # few", "+block.trials = 12  # few"]),
        ("orders", OWN, "main", "4 dyadic", ['-main = "2 dyadic, 2 bimanual"', '+main = "4 dyadic"']),
        ("kinds.dyadic", OWN, "catch", "3", ["-catch = 0.25 # a quarter", "+catch = 3 # a quarter"]),
        ("kinds.dyadic", "block", "rest", "30.0", ["+block.rest = 30.0"]),
        (
            "factors.haptics.levels.off",
            "block",
            "force",
            "partner_only",
            ['-levels.off.block.force = "none"', '+levels.off.block.force = "partner_only"'],
        ),
        ("factors.haptics.levels.on", OWN, "value", "2.5", ["+levels.on.value = 2.5"]),
        ("questionnaires.effort", OWN, "wait", "60", ["+wait = 60"]),
    ],
)
def test_a_change_is_one_line(part: str, form: str, key: str, entry: str, expected: list[str]) -> None:
    assert changed(part, form, key, entry) == expected


def test_new_line_is_at_the_end_of_its_table_and_before_the_comment_of_the_next() -> None:
    made = changed_study(TEXT, field("factors.haptics", OWN, "order"), "random").splitlines()
    place = made.index('order = "random"')
    assert made[place - 1] == 'levels.off.block.force = "none"'
    assert made[place + 1 : place + 3] == ["", "# Both together."]
    assert parse_study("\n".join(made)).factors["haptics"].order == "random"


@pytest.mark.parametrize(
    ("part", "form", "key", "entry", "said"),
    [
        ("kinds.dyadic", OWN, "catch", "-1", r"\[kinds.dyadic\] catch: found -1, expected"),
        ("study", OWN, "name", "two words", "name: found"),
        ("orders", OWN, "main", "2 triadic", "triadic"),
        ("questionnaires.effort.questions.load", OWN, "text", "And now?", "use the text"),
    ],
)
def test_what_is_not_valid_is_refused_in_words(part: str, form: str, key: str, entry: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        changed_study(TEXT, field(part, form, key), entry)


def test_parts_without_a_name_in_a_text_have_their_defaults() -> None:
    text = 'name = "x"\n[orders]\nmain = "dyadic"\n[kinds.dyadic]\n'
    made = changed_study(text, field("kinds.dyadic", OWN, "catch", text), "0.5")
    assert parse_study(made).kinds["dyadic"] == Kind(catch=0.5)
    assert 'question = "Why?"' in changed_study(text, field("analysis", OWN, "question", text), "Why?")


def collection(name: str, text: str = TEXT) -> Collection:
    """Return a collection of a study by its name."""
    return {one.name: one for one in collections_of(parse_study(text))}[name]


def lines_between(before: str, after: str) -> list[str]:
    """Return the lines that are removed and added, without empty ones."""
    found = (line for line in ndiff(before.splitlines(), after.splitlines()) if line[0] in "+-" and line[2:].strip())
    return [line[0] + line[2:] for line in found]


def test_collections_are_those_of_the_declarations() -> None:
    assert [(one.name, one.holds, one.names) for one in collections_of(parse_study(TEXT))] == [
        ("orders", str, ("main",)),
        ("factors", Factor, ("haptics",)),
        ("factors.haptics.levels", Level, ("on", "off")),
        ("kinds", Kind, ("dyadic", "bimanual")),
        ("questionnaires", Questionnaire, ("effort",)),
        ("questionnaires.effort.questions", FormQuestion, ("load",)),
    ]


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("orders", ['+new = "dyadic"']),
        ("factors", ["+[factors.new]", "+[factors.new.levels.first]", "+[factors.new.levels.second]"]),
        ("factors.haptics.levels", ["+[factors.haptics.levels.new]", '+block.force = "none"']),
        ("kinds", ["+[kinds.new]", '+performers = "AB"']),
        ("questionnaires", ["+[questionnaires.new]", '+text = "?"']),
        (
            "questionnaires.effort.questions",
            ["+[questionnaires.effort.questions.new]", '+kind = "vas"', '+text = "How hard was it?"'],
        ),
    ],
)
def test_a_part_is_added_as_a_copy_of_the_last_or_with_what_it_must_have(where: str, expected: list[str]) -> None:
    made = with_part(TEXT, collection(where), "new")
    assert lines_between(TEXT, made) == expected
    assert collection(where, made).names == (*collection(where).names, "new")


@pytest.mark.parametrize("name", [*library.names(), library.TEMPLATE])
def test_parts_of_built_in_studies_can_be_added_and_removed_again(name: str) -> None:
    text = library.text_of(name)
    study = parse_study(text)
    for one in collections_of(study):
        if name == library.TEMPLATE and one.name == "factors.haptics.levels":
            with pytest.raises(ConfigError, match="which has 3 levels, expected two"):
                with_part(text, one, "fresh")
            continue
        made = with_part(text, one, "fresh")
        assert parse_study(made) != study
        assert parse_study(without_part(made, (*one.path, "fresh"))) == study


def test_comment_of_the_next_part_stays_and_that_of_a_removed_one_goes() -> None:
    text = TEXT.replace("2 dyadic, 2 bimanual", "2 bimanual").replace('after = ["dyadic"]\n', "")
    made = without_part(text, ("kinds", "dyadic"))
    assert lines_between(text, made) == ["-# Both together.", "-[kinds.dyadic]", "-catch = 0.25 # a quarter"]
    made = without_part(TEXT, ("factors", "haptics"))
    assert "\n\n# Both together.\n[kinds.dyadic]\n" in made
    assert made.startswith("# A study of ours.\n")


@pytest.mark.parametrize(
    ("where", "name", "said"),
    [
        ("kinds", "dyadic", "kinds: found dyadic already, expected another name"),
        ("kinds", "two words", r"expected a name of letters, digits, _ and -"),
        ("kinds", "session", "expected another name; this one stands for the end of a session"),
        ("factors", "all", "expected another name; this one stands for all factors"),
        ("questionnaires.effort.questions", "session_id", "this one is a column of exports"),
    ],
)
def test_name_that_is_not_possible_is_refused_in_words(where: str, name: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        with_part(TEXT, collection(where), name)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        (("kinds", "bimanual"), r'\[orders\] main: found "bimanual", expected one of dyadic'),
        (("factors", "haptics", "levels", "on"), r"\[factors.haptics\] levels: found 1, expected two or more"),
        (("orders", "main"), r"\[orders\]: found none"),
    ],
)
def test_part_that_another_one_needs_is_not_removed(path: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        without_part(TEXT, path)


def test_part_that_is_written_in_one_line_with_others_is_left_to_the_text() -> None:
    line = 'questions = { load = { kind = "vas", text = "How hard was it?" }, ease = { text = "How easy?" } }'
    text = TEXT.replace('questions.load = { kind = "vas", text = "How hard was it?" }', line)
    path = ("questionnaires", "effort", "questions", "ease")
    with pytest.raises(ConfigError, match=r"effort.questions.ease: is written over several lines, .*use the text"):
        without_part(text, path)
    with pytest.raises(ConfigError, match=r"effort.questions.new: is written over several lines, .*use the text"):
        with_part(text, collection("questionnaires.effort.questions", text), "new")
