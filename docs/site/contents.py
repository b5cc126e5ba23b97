"""Tables of contents: the lists of a folder's README.md.

Each page that a README.md of docs/ lists becomes an entry of the site's navigation, under the heading of its list. So a
page is added in one place, which serves the readers of the repository as well. A README.md claims the pages of its own
folder, the README.md files of the folders in it, and pages outside docs/; what else it lists is a cross-reference.
"""

from pathlib import PurePosixPath
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class ListedPages(SphinxTransform):
    """Appends a hidden table of contents for each heading of a README.md that lists pages."""

    default_priority = 500

    def apply(self, **kwargs: Any) -> None:
        """Read the lists of a page, and add its tables of contents."""
        page = PurePosixPath(self.env.docname)
        if page.name != "README" or page.parts[0] != "docs":
            return
        listed: dict[str, list[str]] = {}
        for link in self.document.findall(addnodes.pending_xref):
            if link["refdomain"] == "doc" and _is_in_list(link) and _claims(page, PurePosixPath(link["reftarget"])):
                listed.setdefault(_heading(link), []).append(link["reftarget"])
        top = next(self.document.findall(nodes.section))
        top.extend(_toctree(str(page), caption, entries) for caption, entries in listed.items())


def _is_in_list(node: nodes.Node) -> bool:
    while node.parent is not None:
        node = node.parent
        if isinstance(node, nodes.list_item):
            return True
    return False


def _claims(page: PurePosixPath, linked: PurePosixPath) -> bool:
    in_folder = linked.parent == page.parent
    return in_folder or linked.parts[0] != "docs" or (linked.name == "README" and linked.parent.parent == page.parent)


def _heading(node: nodes.Node) -> str:
    """Return the heading above a node, or nothing if that is the title of the page."""
    while not isinstance(node, nodes.section):
        node = node.parent
    return "" if isinstance(node.parent, nodes.document) else node[0].astext()


def _toctree(page: str, caption: str, entries: list[str]) -> addnodes.toctree:
    return addnodes.toctree(
        "",
        parent=page,
        caption=caption,
        rawcaption=caption,
        entries=[(None, entry) for entry in entries],
        includefiles=entries,
        maxdepth=1,
        glob=False,
        hidden=True,
        includehidden=False,
        numbered=0,
        titlesonly=True,
    )


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(ListedPages)
    return {"parallel_read_safe": True}
