"""The package list equals the tree."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETUPTOOLS = PROJECT["tool"]["setuptools"]


def folder(package: str) -> Path:
    _, *names = package.split(".")
    return (ROOT if names[:1] == ["services"] else ROOT / "src" / "netboard").joinpath(*names)


def test_listed_packages_equal_the_tree() -> None:
    source = ROOT / "src"
    found = {".".join(init.parent.relative_to(source).parts) for init in source.rglob("__init__.py")}
    services = {
        ".".join(("netboard", *init.parent.relative_to(ROOT).parts))
        for init in (ROOT / "services").rglob("__init__.py")
    }
    assert sorted(SETUPTOOLS["packages"]) == sorted(found | services)


def test_every_folder_with_modules_is_a_package() -> None:
    folders = {module.parent for module in [*(ROOT / "src").rglob("*.py"), *(ROOT / "services").rglob("*.py")]}
    assert {folder for folder in folders if not (folder / "__init__.py").is_file()} == set()


def test_packages_are_at_most_wing_and_room_deep() -> None:
    assert all(package.count(".") <= 2 for package in SETUPTOOLS["packages"])


def test_data_files_are_packaged() -> None:
    listed = {folder(package) / name for package, names in SETUPTOOLS["package-data"].items() for name in names}
    kinds = ("*.md", "*.c", "*.h", "*.toml", "*.jinja", "*.css", "*.json", "*.mcap")
    assert listed == {path for kind in kinds for path in (ROOT / "src").rglob(kind)}


REGISTRATION = """
import sys

if "gymnasium" in sys.modules:
    import netboard.participants.environments.registration  # noqa: F401  (it registers them)
"""
"""In the one of netboard: `gymnasium.make("netboard:...")` imports nothing else."""


def test_init_holds_only_a_docstring() -> None:
    for init in [*(ROOT / "src" / "netboard").rglob("__init__.py"), *(ROOT / "services").rglob("__init__.py")]:
        text = init.read_text(encoding="utf-8").removesuffix(REGISTRATION)
        assert re.fullmatch(r'"""[^"]+"""\n', text), init


def test_no_service_shadows_a_standard_module() -> None:
    names = {service.stem for service in (ROOT / "services").rglob("*.py")}
    assert names & set(sys.stdlib_module_names) == set()


def test_citation_names_the_newest_version_of_the_changelog() -> None:
    newest = re.search(r"^## \[([\d.]+)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None
    assert f"\nversion: {newest[1]}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_changes_are_files_of_a_kind_that_the_changelog_has() -> None:
    kinds = "|".join(kind["directory"] for kind in PROJECT["tool"]["towncrier"]["type"])
    names = {path.name for path in (ROOT / "changes").iterdir()} - {"README.md"}
    assert {name for name in names if not re.fullmatch(rf"[a-z0-9-]+\.({kinds})\.md", name)} == set()


def test_every_requirement_is_constrained() -> None:
    lines = (ROOT / "requirements" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {plain(line.split("==")[0]) for line in lines if "==" in line}
    project = PROJECT["project"]
    extras = [name for group in project["optional-dependencies"].values() for name in group]
    wanted = {plain(re.split(r"[<>=!~\[ ]", requirement)[0]) for requirement in [*project["dependencies"], *extras]}
    assert wanted - {"netboard"} <= pinned


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.skipif(not (ROOT / ".git").exists() or shutil.which("git") is None, reason="not a repository")
def test_repository_has_no_other_folders_at_the_top() -> None:
    command = ["git", "-c", "safe.directory=*", "ls-files"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout
    folders = {path.split("/")[0] for path in listed.splitlines() if "/" in path}
    assert folders == {".ci", ".github", "changes", "deploy", "docs", "requirements", "services", "src", "tests"}
