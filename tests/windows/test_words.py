"""Every language has every text with the same placeholders; errors name the key."""

import string
from dataclasses import fields, replace

import pytest
from display_parts import WORDS

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.windows.participant.language import LANGUAGES, load_words
from netboard.windows.participant.words import FILLED, DisplayTexts, instructions, parse_words

KEYS = [field.name for field in fields(DisplayTexts)]
SAMPLES = {"block": 3, "blocks": 18, "trial": 4, "trials": 60, "time": "2.90", "end": "x", "hold": "1.5", "host": "h"}


def listed(**changes):
    words = {key: getattr(WORDS, key) for key in KEYS} | changes
    return "\n".join(f'{key} = "{word}"' for key, word in words.items() if word is not None)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_language_is_whole(language):
    words = load_words(language)
    for key in KEYS:
        word = getattr(words, key)
        asked = {name for _, name, *_ in string.Formatter().parse(word) if name is not None}
        assert asked == FILLED.get(key, set())
        assert word.format(**SAMPLES, port=5550).strip()
        assert language == "en" or key in ("decimal", "best") or word != getattr(WORDS, key)


def test_a_list_of_ones_own_is_read(tmp_path):
    file = tmp_path / "nl.toml"
    file.write_text(listed(paused="Gepauzeerd"), encoding="utf-8")
    assert load_words(str(file)) == replace(WORDS, paused="Gepauzeerd")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"paused": None}, "words.toml: paused: missing"),
        ({"posed": "x"}, "words.toml: posed: unknown text"),
        ({"paused": ""}, "paused: found '', expected a text"),
        ({"trial": "Trial"}, "trial: found 'Trial', expected {trial} and {trials} placeholders"),
        ({"paused": "Paused {why}"}, "expected no placeholders"),
        ({"paused": "Paused {"}, "paused: found 'Paused {'"),
    ],
)
def test_what_is_wrong_with_a_list_is_said(changes, message):
    with pytest.raises(ConfigError) as error:
        parse_words(listed(**changes), "words.toml")
    assert message in str(error.value)


def test_what_is_no_list_at_all_is_said(tmp_path):
    with pytest.raises(ConfigError, match="not valid TOML"):
        parse_words("=", "words.toml")
    with pytest.raises(ConfigError, match="paused: found 3"):
        parse_words(listed().replace('"Paused"', "3"), "words.toml")
    with pytest.raises(
        ConfigError, match=r"\[display\] language: found 'klingon', expected en, de, fr, es, it or a file"
    ):
        load_words("klingon")


def read(text, station="left"):
    return instructions(parse(text), WORDS, station)


def test_the_standard_instructions_are_those_of_the_condition():
    assert WORDS.left_end in read("")
    assert WORDS.right_end in read("", "right")
    assert WORDS.felt in read("")
    assert WORDS.unfelt in read('[block]\nforce = "none"')
    assert WORDS.who_bimanual in read('[block]\nconfiguration = "bimanual"')
    assert "held still" in read('[block]\nright = "still"')
    assert WORDS.task_board in read("[physics]\nballs = 0")
    assert "1.5 s" in read("")
    assert "1,5 s" in instructions(Config(), load_words("de"), "left")


def test_a_blocks_own_instructions_go_before():
    assert read('[block]\ninstructions = "Do as you like."') == "Do as you like."
