"""Pages of source files: what a link to a file or a folder of the repository shows on the site.

The pages link to source files by relative paths, which the repository's pages follow. The site has a page for each
linked text file, with its lines highlighted and numbered, and one for each linked folder, with a list of its files.
Other files that are linked, such as images, are downloads. Nothing points to a host, so the site works offline.
"""

import html
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform

KIND = "repository file"
"""Type of a reference to a page of a file or folder."""
FOLDER = "files"
"""Where these pages are on the site."""


class SourceLinks(SphinxTransform):
    """Points links to files and folders of the repository to their pages."""

    default_priority = 5

    def apply(self, **kwargs: Any) -> None:
        """Replace what MyST makes of such links: a download of a file, or a reference that it cannot resolve."""
        linked: set[str] = set()
        for link in list(self.document.findall(_is_link)):
            target, _, _ = link["reftarget"].partition("#")
            path = (Path(self.env.doc2path(self.env.docname)).parent / target).resolve()
            if target and path.is_relative_to(self.env.srcdir) and _has_page(path):
                name = path.relative_to(self.env.srcdir).as_posix()
                linked.add(name)
                reference = addnodes.pending_xref("", refdomain="", reftype=KIND, reftarget=name, refexplicit=True)
                reference["refdoc"], reference.source, reference.line = self.env.docname, link.source, link.line
                reference.extend(link.children)
                link.replace_self(reference)
        linked_files(self.env)[self.env.docname] = linked


def _is_link(node: nodes.Node) -> bool:
    if isinstance(node, addnodes.download_reference):
        return True
    return isinstance(node, addnodes.pending_xref) and node.get("reftype") == "myst" and node.get("refdomain") != "doc"


def _has_page(path: Path) -> bool:
    return path.is_dir() or (path.is_file() and b"\0" not in path.read_bytes()[:4096])


def linked_files(env: BuildEnvironment) -> dict[str, set[str]]:
    """Return the linked files and folders, by page."""
    if not hasattr(env, "netboard_linked_files"):
        env.netboard_linked_files = {}  # type: ignore[attr-defined]
    found: dict[str, set[str]] = env.netboard_linked_files  # type: ignore[attr-defined]
    return found


def _page(name: str) -> str:
    return f"{FOLDER}/{name}"


def resolve(app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, inner: nodes.Node) -> nodes.Node | None:
    """Return the link to the page of a file."""
    if node["reftype"] != KIND:
        return None
    uri = app.builder.get_relative_uri(node["refdoc"], _page(node["reftarget"]))
    return nodes.reference("", "", inner, internal=True, refuri=uri, reftitle=node["reftarget"])


def make_pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yield the pages of all linked files and folders."""
    names = set().union(*linked_files(app.env).values())
    for name in sorted(names):
        path = Path(app.srcdir) / name
        body = _listing(app, path, name, names) if path.is_dir() else _listed_file(path)
        title = html.escape(name)
        yield _page(name), {"title": title, "body": f"<h1><code>{title}</code></h1>{body}"}, "page.html"


def _listed_file(path: Path) -> str:
    try:
        lexer = get_lexer_for_filename(path.name)
    except ClassNotFound:
        lexer = TextLexer()
    formatter = HtmlFormatter(linenos="inline", lineanchors="L", anchorlinenos=True, wrapcode=True)
    return highlight(path.read_text(encoding="utf-8"), lexer, formatter)


def _listing(app: Sphinx, path: Path, name: str, names: set[str]) -> str:
    items = []
    for file in sorted(file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts):
        full, shown = file.relative_to(app.srcdir).as_posix(), html.escape(file.relative_to(path).as_posix())
        uri = app.builder.get_relative_uri(_page(name), _page(full))
        items.append(f'<li><a href="{uri}">{shown}</a></li>' if full in names else f"<li><code>{shown}</code></li>")
    return f"<ul>{''.join(items)}</ul>"


def forget(app: Sphinx, env: BuildEnvironment, docname: str) -> None:
    """Drop the links of a page that is read again."""
    linked_files(env).pop(docname, None)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform, the resolver and the pages."""
    app.add_transform(SourceLinks)
    app.connect("missing-reference", resolve)
    app.connect("env-purge-doc", forget)
    app.connect("html-collect-pages", make_pages)
    return {"parallel_read_safe": False}
