"""The README begins with the commands; the glossary has every term."""

from pathlib import Path

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
GLOSSARY = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")
WORDS = (
    "device stylus side station message frame event command node service trial block session plan recording scene view"
)


def test_readme_starts_with_the_two_make_commands() -> None:
    top = README.splitlines()[:18]
    assert any(line.startswith("make demo") for line in top)
    assert any(line.startswith("make test") for line in top)


def test_readme_names_the_processes() -> None:
    part = README.partition("## Processes")[2].partition("\n## ")[0]
    for command in ("server", "agent", "display", "logger", "replay"):
        assert f"`netboard {command}" in part


def test_glossary_has_every_term() -> None:
    for word in WORDS.split():
        assert f"| **{word}** |" in GLOSSARY, word


def test_readme_states_the_limits() -> None:
    assert "## What it does not do yet" in README
