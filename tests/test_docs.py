"""The generated pages are up to date, and no link is broken."""

import importlib
import json
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from netboard.base.tables.forces import FORCES

ROOT = Path(__file__).parent.parent
SKIPPED = {".venv", "build", "dist", "node_modules", ".pytest_cache", "recordings"}
PAGES = sorted(page for page in ROOT.rglob("*.md") if not SKIPPED & set(page.relative_to(ROOT).parts))

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


@pytest.fixture
def generate(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    return importlib.import_module("generate")


def test_generated_parts_are_up_to_date() -> None:
    # in a process of its own: others of these tests add plug-ins, which the help of a command then lists
    run = subprocess.run(
        [sys.executable, "docs/generate.py", "--check"], check=False, cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout + run.stderr


def test_generation_is_idempotent(generate: ModuleType) -> None:
    page = "head\n<!-- generated: x -->\nold\n<!-- end of x -->\ntail\n"
    once = generate.renewed(page, "x", "new")
    assert "new" in once
    assert "old" not in once
    assert generate.renewed(once, "x", "new") == once


def test_page_without_its_marks_is_refused(generate: ModuleType) -> None:
    with pytest.raises(ValueError, match="once each"):
        generate.renewed("no marks", "x", "new")


def test_measured_forces_are_those_of_every_condition() -> None:
    (part,) = json.loads((ROOT / "docs" / "data" / "forces.json").read_text(encoding="utf-8"))["parts"]
    assert sorted(row[0] for row in part["rows"]) == sorted(FORCES), "copy the results of: make evidence ARGS=forces"


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as code hosts make them."""
    headings = HEADING.findall(FENCE.sub("", page.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_are_not_broken(page: Path) -> None:
    broken = []
    # A change becomes part of the changelog, so its links are those of the changelog.
    folder = ROOT if page.parent.name == "changes" and page.name != "README.md" else page.parent
    for target in LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        linked = (folder / file).resolve() if file else page
        if not linked.exists() or (anchor and linked.suffix == ".md" and anchor not in anchors(linked)):
            broken.append(target)
    assert broken == []


def test_every_page_of_docs_is_listed_in_the_readme_of_its_folder() -> None:
    """The site makes its tables of contents from these lists, from the landing page on."""
    docs = ROOT / "docs"
    reached, waiting = set(), [docs / "README.md"]
    while waiting:
        page = waiting.pop()
        reached.add(page)
        if page.name == "README.md":
            items = re.findall(r"^(?:- |\d+\. ).*(?:\n  .*)*", page.read_text(encoding="utf-8"), re.MULTILINE)
            listed = {(page.parent / target).resolve() for item in items for target in LINK.findall(item)}
            waiting += [linked for linked in listed - reached if docs in linked.parents]
    pages = {page for kind in ("md", "ipynb") for page in docs.rglob(f"*.{kind}")}
    assert sorted(pages - reached) == []
