"""A report in a real browser: nothing of it is outside of the window at any size, and it has the desktop's theme."""

from itertools import product
from pathlib import Path

import pytest

from evidence.looks.report_pages import THEMES, made_report, measured
from netboard.base.looks import DARK, LIGHT, ThemeName

pytestmark = pytest.mark.site

SIZES = ((1366, 768), (1920, 1080), (3840, 2160))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_report(tmp_path_factory.mktemp("report"))


def rgb(colour: str) -> str:
    """Return a colour as a browser says it."""
    return f"rgb({', '.join(str(int(colour[at : at + 2], 16)) for at in (1, 3, 5))})"


@pytest.mark.parametrize(("size", "theme"), list(product(SIZES, THEMES)))
def test_report_is_whole_at_every_size_and_in_both_themes(
    report: Path, size: tuple[int, int], theme: ThemeName, tmp_path: Path
) -> None:
    picture = tmp_path / "report.png"
    found = measured(report, size, theme, picture)
    assert (tuple(found.size), found.beyond, found.outside) == (size, 0, [])
    assert found.background == rgb({"dark": DARK, "light": LIGHT}[theme].background)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_what_is_outside_of_the_window_is_found(report: Path, tmp_path: Path) -> None:
    broken = tmp_path / "report.html"
    page = report.read_text(encoding="utf-8")
    broken.write_text(page.replace("</body>", '<div style="width: 3000px">far too wide</div></body>'), encoding="utf-8")
    found = measured(broken, SIZES[0], "light")
    assert found.beyond
    assert found.outside == ["DIV far too wide"]
