"""The built site: no link is broken, nothing is loaded from elsewhere, and a browser finds pages by its search.

`make test-site` builds the site first. `make test` leaves these tests out: a build and a browser take too long for it.
"""

import functools
import re
import threading
from collections.abc import Iterator
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from browser import opened

pytestmark = pytest.mark.site

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build" / "site"
LOADED = {"img": "src", "link": "href", "script": "src", "source": "src", "video": "src"}


class PageLinks(HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.loaded: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value is not None}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.add(given["href"])
        if (name := LOADED.get(tag)) in given:
            self.loaded.add(given[str(name)])


@pytest.fixture(scope="module")
def pages() -> dict[Path, PageLinks]:
    read = {page: PageLinks(page) for page in sorted(SITE.rglob("*.html")) if page.parent.name != "_static"}
    assert len(read) > 100, "build the site first: make test-site"
    return read


def test_links_and_anchors_exist(pages: dict[Path, PageLinks]) -> None:
    broken = []
    for page, parsed in pages.items():
        for link in sorted(parsed.links | parsed.loaded):
            parts = urlsplit(link)
            if parts.scheme or link in ("#", ""):
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            anchor = unquote(parts.fragment)
            if not target.is_file() or (anchor and target in pages and anchor not in pages[target].anchors):
                broken.append(f"{page.relative_to(SITE)}: {link}")
    assert broken == []


def test_no_page_loads_anything_from_another_host(pages: dict[Path, PageLinks]) -> None:
    loaded = {link for parsed in pages.values() for link in parsed.loaded}
    assert [link for link in loaded if urlsplit(link).netloc] == []


def test_source_files_have_numbered_lines(pages: dict[Path, PageLinks]) -> None:
    page = SITE / "files" / "src" / "netboard" / "stage" / "stage.py.html"
    source = ROOT / "src" / "netboard" / "stage" / "stage.py"
    lines = {anchor for anchor in pages[page].anchors if re.fullmatch(r"L-\d+", anchor)}
    assert len(lines) == len(source.read_text(encoding="utf-8").splitlines())


class SilentHandler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Address of a server of the site."""
    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(SilentHandler, directory=str(SITE))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def results(dom: str) -> list[str]:
    """Titles of the pages that the search page lists."""
    found = re.findall(r'<li class="kind-\w+"><a href="[^"]*"[^>]*>(.*?)</a>', dom)
    return [re.sub(r"<[^>]*>", "", title) for title in found]


def test_address_without_a_page_opens_the_landing_page(address: str, tmp_path: Path) -> None:
    dom = opened(f"{address}/", tmp_path)
    assert re.search(r"<h1>netboard: dyadic haptic experiments", dom)


@pytest.mark.parametrize("words", ["virtual coupling", "force feedback", "confidence interval", "counterbalanced"])
def test_search_finds_pages(words: str, address: str, tmp_path: Path) -> None:
    found = results(opened(f"{address}/search.html?q={words.replace(' ', '+')}", tmp_path))
    assert found
    if words == "virtual coupling":
        assert "Maximum stable delay of the virtual coupling" in found[:5]


def test_search_works_from_files_without_a_server(tmp_path: Path) -> None:
    found = results(opened(f"file://{SITE}/search.html?q=virtual+coupling", tmp_path))
    assert "Maximum stable delay of the virtual coupling" in found


def test_search_finds_nothing_for_words_that_no_page_has(address: str, tmp_path: Path) -> None:
    assert results(opened(f"{address}/search.html?q=qwertyuiop", tmp_path)) == []
