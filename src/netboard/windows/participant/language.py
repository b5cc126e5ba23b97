"""Load a display's texts: in a language of the package, or from a file of the user."""

from importlib import resources
from pathlib import Path

from netboard.base.errors import ConfigError
from netboard.base.files.text import read_text
from netboard.windows.participant.words import DisplayTexts, parse_words

LANGUAGES = ("en", "de", "fr", "es", "it")
"""The languages of the package."""


def load_words(language: str) -> DisplayTexts:
    """Load the texts of one of `LANGUAGES`, or of a TOML file."""
    if language in LANGUAGES:
        text = (resources.files("netboard.windows.participant") / "languages" / f"{language}.toml").read_text(
            encoding="utf-8"
        )
        return parse_words(text, f"{language}.toml")
    try:
        text = read_text(Path(language))
    except ConfigError as error:
        raise ConfigError(
            f'[display] language: found "{language}", expected {", ".join(LANGUAGES)} or a file of texts; {error}'
        ) from error
    return parse_words(text, language)
