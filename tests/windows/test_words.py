"""Every language has every text with the same placeholders, and errors name the key."""

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


def word_list(**changes):
    words = {key: getattr(WORDS, key) for key in KEYS} | changes
    return "\n".join(f'{key} = "{word}"' for key, word in words.items() if word is not None)


@pytest.mark.parametrize("language", LANGUAGES)
def test_language_has_every_text_with_its_placeholders(language):
    words = load_words(language)
    for key in KEYS:
        word = getattr(words, key)
        asked = {name for _, name, *_ in string.Formatter().parse(word) if name is not None}
        assert asked == FILLED.get(key, set())
        assert word.format(**SAMPLES, port=5550).strip()
        assert language == "en" or key in ("decimal", "best") or word != getattr(WORDS, key)


def test_custom_word_list_is_loaded_from_a_file(tmp_path):
    file = tmp_path / "nl.toml"
    file.write_text(word_list(paused="Gepauzeerd"), encoding="utf-8")
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
        ({"last": "Last {time:.1f} s"}, "last: found 'Last {time:.1f} s': Unknown format code 'f'"),
        ({"best": "best {time:{digits}} s"}, "best: found 'best {time:{digits}} s'"),
    ],
)
def test_invalid_word_list_is_refused_naming_the_key(changes, message):
    with pytest.raises(ConfigError) as error:
        parse_words(word_list(**changes), "words.toml")
    assert message in str(error.value)


def test_malformed_word_file_or_unknown_language_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="not valid TOML"):
        parse_words("=", "words.toml")
    with pytest.raises(ConfigError, match="paused: found 3"):
        parse_words(word_list().replace('"Paused"', "3"), "words.toml")
    with pytest.raises(
        ConfigError, match=r'\[display\] language: found "klingon", expected en, de, fr, es, it or a file of texts'
    ):
        load_words("klingon")


def instructions_of(text, station="left"):
    return instructions(parse(text), WORDS, station)


def test_standard_instructions_match_the_condition():
    assert WORDS.left_end in instructions_of("")
    assert WORDS.right_end in instructions_of("", "right")
    assert WORDS.felt in instructions_of("")
    assert WORDS.unfelt in instructions_of('[block]\nforce = "none"')
    assert WORDS.who_bimanual in instructions_of('[block]\nconfiguration = "bimanual"')
    assert "held still" in instructions_of('[block]\nright = "still"')
    assert WORDS.task_board in instructions_of("[physics]\nballs = 0")
    assert "1.5 s" in instructions_of("")
    assert "1,5 s" in instructions(Config(), load_words("de"), "left")


def test_instructions_of_the_block_replace_the_standard_ones():
    assert instructions_of('[block]\ninstructions = "Do as you like."') == "Do as you like."
