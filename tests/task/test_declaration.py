"""What a study declares about its analysis reaches every block; invalid declarations are refused in words."""

import json

import pytest

from netboard.base.config import Config, parse, resolve
from netboard.base.errors import ConfigError
from netboard.base.tables.outcomes import Declaration
from netboard.task.plans.plan import blocks_of, plan_of, to_json
from netboard.task.studies import library
from netboard.task.studies.declaration import declaration_of, declaration_text, read_declaration
from netboard.task.studies.study import digest_of_study, parse_study, resolve_study

STUDY = """
orders.main = "4 duo, 2 solo"
orders.other = "4 duo"
[factors.haptics]
levels.on.block.force = "full"
levels.off.block.force = "none"
[factors.mass]
order = "random"
levels.light.physics.m = 0.02
levels.heavy.physics.m = 0.05
levels.middle.physics.m = 0.03
[factors.age]
order = "between"
levels.young = {}
levels.old = {}
[kinds.duo]
[kinds.solo]
performers = "AB"
factors = ["haptics"]
[kinds.practice]
[analysis]
"""


def declared(primary: str = "completion time", contrast: str = "haptics", more: str = "") -> Declaration:
    text = f"{STUDY}primary = '{primary}'\ncontrast = '{contrast}'\n{more}"
    return declaration_of(parse_study(text))


def problem(primary: str = "completion time", contrast: str = "haptics", more: str = "") -> str:
    with pytest.raises(ConfigError) as error:
        declared(primary, contrast, more)
    return str(error.value)


@pytest.mark.parametrize(
    ("written", "full"),
    [
        ("haptics", "haptics: on vs off"),
        ("haptics: off vs on", "haptics: off vs on"),
        ("mass: heavy vs light  x  haptics", "mass: heavy vs light x haptics: on vs off"),
        ("kind x haptics", "kind: duo vs solo x haptics: on vs off"),
        ("age x haptics", "age: young vs old x haptics: on vs off"),
    ],
)
def test_recorded_contrast_has_both_levels(written: str, full: str) -> None:
    text = STUDY.replace("levels.middle.physics.m = 0.03", "").replace('factors = ["haptics"]', "")
    study = parse_study(f"{text}primary = 'completion time'\ncontrast = '{written}'\n")
    assert declaration_of(study).contrast == full


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"primary": "completion_time"},
            'primary: found "completion_time", expected one of completion time',
        ),
        ({"primary": "completion_time"}, "did you mean completion time?"),
        (
            {"contrast": "haptic"},
            'contrast: found "haptic", expected one of haptics, mass, age, kind; did you mean haptics',
        ),
        ({"contrast": ""}, "[analysis] contrast: found none, expected one of haptics, mass, age, kind"),
        ({"contrast": "haptics: on vs of"}, 'found level "of" of haptics, expected one of on, off; did you mean off?'),
        ({"contrast": "haptics: on vs on"}, 'found "haptics: on vs on", expected two different levels'),
        (
            {"contrast": "mass"},
            'found "mass", which has 3 levels, expected two of them, such as "mass: light vs heavy"',
        ),
        ({"contrast": "haptics x haptics"}, "expected one factor, or two different ones"),
        ({"contrast": "haptics x age x kind"}, "expected one factor, or two different ones"),
        ({"contrast": "haptics:"}, 'found "haptics:", expected a factor, such as'),
        (
            {"contrast": "mass: light vs heavy x kind"},
            "cannot be estimated: no test block of order main has mass light, kind solo",
        ),
        (
            {"contrast": "haptics x kind"},
            "cannot be estimated: in order main the levels of haptics x kind differ in other factors, too",
        ),
        ({"contrast": "kind: duo vs practice"}, 'found level "practice" of kind, expected one of duo, solo'),
        ({"primary": "SPARC", "more": 'method = "model"'}, '"t" or "permutation": no model of SPARC'),
        ({"contrast": "age", "more": 'method = "permutation"'}, "age varies between dyads"),
        ({"more": 'secondary = ["completion time"]'}, 'secondary: found "completion time" twice'),
        ({"more": 'secondary = ["speed"]'}, 'secondary: found "speed", expected one of'),
        ({"primary": ""}, "[analysis] contrast: found one without a primary outcome"),
        ({"more": "level = 1.0"}, "[analysis] level: found 1.0, expected a number"),
        ({"more": "p = 1"}, "[analysis] p: unknown key"),
    ],
)
def test_invalid_declarations_are_refused_in_words(changes: dict[str, str], words: str) -> None:
    assert words in problem(**changes)


def test_contrast_of_a_kind_that_no_order_has_is_refused() -> None:
    text = f"order = ['other']\n{STUDY}primary = 'completion time'\ncontrast = 'kind'\n"
    with pytest.raises(ConfigError, match="no test block of order other has kind solo"):
        parse_study(text)


def test_declaration_travels_to_every_block_and_back() -> None:
    study = parse_study(library.text_of("paper"), "paper")
    assert parse_study(resolve_study(study)) == study
    blocks = blocks_of(Config(), study, 1, 1)
    assert {config.analysis for config in blocks} == {declaration_of(study)}
    assert parse(resolve(blocks[0])).analysis == declaration_of(study)
    assert read_declaration(declaration_text(blocks[0].analysis)) == declaration_of(study)
    assert declaration_text(Declaration()) == ""
    assert read_declaration("") == Declaration()


def test_neither_plan_nor_digest_of_the_study_depends_on_the_declaration() -> None:
    study = parse_study(library.text_of("paper"), "paper")
    bare = parse_study(library.text_of("paper").partition("[analysis]")[0], "paper")
    assert digest_of_study(bare) == digest_of_study(study)
    assert to_json(plan_of(bare, 1, 3)) == to_json(plan_of(study, 1, 3))
    assert "analysis" not in json.loads(to_json(plan_of(study, 1, 3)))["sessions"][0]["blocks"][0]


@pytest.mark.parametrize("name", [name for name in library.NAMES if name != "pilot"])
def test_built_in_studies_declare_their_analysis(name: str) -> None:
    found = declaration_of(parse_study(library.text_of(name), name))
    assert found.question.endswith("?")
    assert found.primary
    assert " vs " in found.contrast


def test_pilot_declares_none() -> None:
    assert declaration_of(parse_study(library.text_of("pilot"), "pilot")) == Declaration()
