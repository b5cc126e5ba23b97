"""No text uses a term that the glossary has replaced, except where it means something else.

Read are README, changelog, the pages of docs/ without the decisions, the specifications, and the docstrings, comments
and help texts of src/ and services/. Code, commands and their output are not read, nor parts of pages that are
generated. `data/language_leftovers.json` counts the terms that still stand in files; its numbers may only fall. After
a file has been reworded, `python tests/test_language.py` lowers them.
"""

import ast
import functools
import io
import json
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parent.parent

TERMS = {
    r"felt forces?|forces? that (?:a|the) hand (?:feels|felt|is told)": "commanded force, rendered force",
    r"(?:with|without|with and without) forces": "haptics on, haptics off; haptic feedback",
    r"(?:sample|stylus)(?:'s)? holds?|first-order holds?": "extrapolation (zero-order hold, constant velocity, ...)",
    r"late ticks?|missed ticks?": "deadline miss",
    r"how late": "tick jitter, latency, time after the deadline",
    r"(?:the )?way there and back|there and back": "round-trip time",
    r"(?:a|each|every|the|no) beats?": "heartbeat",
    r"doors?": "endpoint, authenticator",
    r"listeners?": "subscriber",
    r"proofs?": "integrity check",
    r"grades?": "severity",
    r"verdicts?": "result",
    r"doubtful": "flagged",
    r"remarks?": "annotation, log message",
    r"foreign": "imported; in another language",
    r"contenders?": "solvers under comparison",
    r"endurance": "stability test",
    r"inert": "passive",
    r"sources? of chance": "random effects",
    r"\d+ % intervals?|honest intervals?": "confidence interval",
    r"unsteady": "flaky",
    r"simulated (?:people|persons?)": "simulated participant",
    r"pictures?": "figure, screenshot",
    r"told(?! apart)": "commanded, sent, published",
    r"heard": "received, acknowledged",
    r"(?:of |at most )?so long(?! as)": "duration, timeout, window",
    r"so many|so much (?:later|longer)": "a number of; delay",
    r"trial machine": "trial state machine",
    r"whoever": "the one that; say who",
    r"(?:is )?no matter of": "is outside",
    r"of the own|the own": "its own, their own",
    r"(?:shel(?:f|ves)|reels?|crews?|desks?|ledgers?)": "what it is, not what it resembles",
}
"""Pattern of each replaced term, and what to write in its place."""

OTHER_MEANINGS = {
    ("src/netboard/windows/participant", "picture"): "what a display paints",
    ("src/netboard/network/protocol/views.py", "picture"): "what a display paints",
    ("docs/explanation/display.md", "picture"): "what a display paints",
    ("docs/explanation/curtain.md", "picture"): "what a display paints",
    ("docs/reference/glossary.md", "picture"): "what a display paints",
    ("src/netboard/network", "listener"): "the name of a role in the protocol",
    ("services/keys.py", "listener"): "the name of a role in the protocol",
}
"""Why a term stays in a file or folder: it has another meaning there, or is a name that users have."""

LEFTOVERS = Path(__file__).parent / "data" / "language_leftovers.json"
"""How many replaced terms still stand in each file."""

GENERATED = re.compile(r"<!-- generated: .*?<!-- end of .*?-->|<!-- tables: begin.*?<!-- tables: end -->", re.DOTALL)
FENCE = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"``[^`\n]+``|`[^`\n]+`|\]\([^)\s]*\)|\w+://\S+", re.MULTILINE)
ENTRY = re.compile(r"^\s*\*{0,2}\w+(?:, \*{0,2}\w+)* : .*$", re.MULTILINE)
HELP = {"help", "epilog", "text", "description"}


class Hit(NamedTuple):
    """A replaced term, and where it stands."""

    file: str
    line: int
    term: str
    instead: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.term!r}; write: {self.instead}"


def blank(match: re.Match[str]) -> str:
    """As many lines as before, of a sign that is no word."""
    return re.sub(r"[^\n]", "#", match[0])


def prose_of_page(text: str) -> Iterator[tuple[int, str]]:
    """A page without what is generated, a command, an output or code; each part with the number of its first line."""
    yield 1, CODE.sub(blank, FENCE.sub(blank, GENERATED.sub(blank, text)))


def prose_of_module(source: str) -> Iterator[tuple[int, str]]:
    """Docstrings, comments and help texts of a module, with the numbers of their first lines.

    Names of classes are code, so only words in lower case count, and a text's first word.
    """
    texts = [
        (token.start[0], token.string.lstrip("# "))
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    ]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            texts.append((node.value.lineno, ENTRY.sub(blank, node.value.value)))
        for shown in shown_texts(node):
            texts.append((shown.lineno, str(shown.value)))
    for line, text in texts:
        yield line, re.sub(r"``?[^`\n]+``?", blank, text[:1].lower() + text[1:])


def shown_texts(node: ast.AST) -> Iterator[ast.Constant]:
    """Texts that a call shows to users: those of options, commands and settings."""
    if not isinstance(node, ast.Call):
        return
    values = [keyword.value for keyword in node.keywords if keyword.arg in HELP]
    if isinstance(node.func, ast.Name) and node.func.id == "about":
        values += node.args[:1]
    for value in values:
        yield from (one for one in ast.walk(value) if isinstance(one, ast.Constant) and isinstance(one.value, str))


@functools.cache
def whole(pattern: str, page: bool) -> re.Pattern[str]:
    """A term as whole words, in a page whatever their case."""
    spaced = pattern.replace(" ", r"\s+")  # a term may be broken over two lines
    return re.compile(rf"(?<![\w-])(?:{spaced})(?![\w-])", re.IGNORECASE if page else 0)


def terms_in(file: str, text: str) -> list[Hit]:
    """Every replaced term in the prose of a file, whatever it means there."""
    page = file.endswith(".md")
    hits = []
    for first, prose in prose_of_page(text) if page else prose_of_module(text):
        if not whole("|".join(TERMS), page).search(prose):  # most texts have none, and one search is enough to tell
            continue
        for pattern, instead in TERMS.items():
            for match in whole(pattern, page).finditer(prose):
                line = first + prose.count("\n", 0, match.start())
                hits.append(Hit(file, line, " ".join(match[0].lower().split()), instead))
    return sorted(hits)


def other_meaning(hit: Hit) -> tuple[str, str] | None:
    """The entry of `OTHER_MEANINGS` by which a term stays in a file."""
    for place, term in OTHER_MEANINGS:
        if hit.term.removesuffix("s") == term and (hit.file == place or hit.file.startswith(f"{place}/")):
            return place, term
    return None


FOLDERS = ("src", "services", "tests/evidence")
"""Folders of the modules."""


def texts() -> dict[str, str]:
    """The text of each file with prose for users or developers, by its path."""
    paths = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")]
    paths += (ROOT / "changes").glob("*.md")
    paths += [page for page in sorted((ROOT / "docs").rglob("*.md")) if "decisions" not in page.parts]
    paths += [*sorted((ROOT / "docs").glob("*.py")), *sorted((ROOT / "src" / "netboard").rglob("*.md"))]
    paths += [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


@functools.cache
def all_terms() -> dict[str, list[Hit]]:
    """Every replaced term in all files, by file."""
    return {name: terms_in(name, text) for name, text in texts().items()}


def all_hits() -> dict[str, list[Hit]]:
    """Replaced terms in all files, without those that mean something else there."""
    kept = {name: [hit for hit in hits if other_meaning(hit) is None] for name, hits in all_terms().items()}
    return {name: hits for name, hits in kept.items() if hits}


def leftovers() -> dict[str, int]:
    """Count of replaced terms that a file may have."""
    counts: dict[str, int] = json.loads(LEFTOVERS.read_text(encoding="utf-8"))
    return counts


def main() -> None:
    """Lower the counts of leftovers to what stands in the files, and print what exceeds them."""
    hits, allowed = all_hits(), leftovers()
    lower = {file: min(count, len(hits[file])) for file, count in allowed.items() if file in hits}
    LEFTOVERS.write_text(json.dumps(lower, indent=2) + "\n", encoding="utf-8")
    for file, found in hits.items():
        if len(found) > allowed.get(file, 0):
            sys.stdout.writelines(f"{hit}\n" for hit in found)


def test_no_text_uses_a_replaced_term_beyond_its_leftovers() -> None:
    allowed = leftovers()
    over = [hit for file, found in all_hits().items() if len(found) > allowed.get(file, 0) for hit in found]
    assert not over, "replaced terms (docs/reference/glossary.md):\n" + "\n".join(map(str, over))


def test_leftover_counts_are_up_to_date() -> None:
    hits = all_hits()
    fewer = [file for file, count in leftovers().items() if len(hits.get(file, ())) < count]
    assert fewer == [], "fewer terms are left than listed; run: python tests/test_language.py"


def test_every_exception_for_another_meaning_is_used() -> None:
    used = {other_meaning(hit) for hits in all_terms().values() for hit in hits}
    assert set(OTHER_MEANINGS) - used == set()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Two contenders.", ["contenders"]),
        ("A `contender`.", []),
        ("```\ncontender\n```", []),
        ("Inert\npartners; [a page](inert.md)", ["inert"]),
        ("<!-- generated: a -->\ninert\n<!-- end of a -->", []),
        ("The colours can be told apart; a server is told.", ["told"]),
        ("Simulated\npeople; as so long as; so long.", ["simulated people", "so long"]),
    ],
)
def test_terms_are_found_in_pages(text: str, found: list[str]) -> None:
    assert [hit.term for hit in terms_in("page.md", text)] == found


def test_terms_are_found_in_modules() -> None:
    source = '''
"""Verdicts of a check."""
# a doubtful one
x = about("How late it is.", unit="s")
y = "a verdict that nobody reads"
def f(told: int) -> "Verdict":
    """Return it.

    Parameters
    ----------
    told : ndarray
        Whether it was told, see `told`.

    Returns
    -------
    list of Verdict
    """
    return Option(help="At most so long.")
'''
    assert [(hit.line, hit.term) for hit in terms_in("module.py", source)] == [
        (2, "verdicts"),
        (3, "doubtful"),
        (4, "how late"),
        (12, "told"),
        (18, "at most so long"),
    ]


if __name__ == "__main__":
    main()
