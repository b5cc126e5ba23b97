"""Figures in an HTML page: as SVG with title and description, or as PNG if the SVG would be huge.

Element ids are made unique, so that figures with the same marks do not share them.
"""

import base64
import re
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

from netboard.analysis.report.wording import visible
from netboard.analysis.topics.figure import Picture, as_bytes

MAX_SVG = 400_000
"""Largest SVG file that is embedded; larger figures are embedded as PNG, in bytes [1]."""

_SVG = "http://www.w3.org/2000/svg"
_HREF = "{http://www.w3.org/1999/xlink}href"
_DROPPED = {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style", f"{{{_SVG}}}title"}


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure prepared for the page."""

    name: str
    title: str
    caption: str
    svg: str = ""
    png: str = ""


def drawing(picture: Picture) -> Drawing:
    """Prepare a figure for the page."""
    words = picture.name, visible(picture.title), visible(picture.caption)
    if picture.figure is None:
        return Drawing(*words)
    file = as_bytes(picture.figure, "svg")
    if len(file) > MAX_SVG:
        data = base64.b64encode(as_bytes(picture.figure, "png")).decode("ascii")
        return Drawing(*words, png=f"data:image/png;base64,{data}")
    return Drawing(*words, svg=_inline(file, *words))


def _inline(file: bytes, name: str, title: str, caption: str) -> str:
    """Return an SVG file as an HTML element."""
    root = ElementTree.fromstring(file)
    for parent in root.iter():
        for child in [child for child in parent if child.tag in _DROPPED]:
            parent.remove(child)
    for element in root.iter():
        element.attrib = dict(_attributes(element.attrib, name))
        element.tag = element.tag.removeprefix(f"{{{_SVG}}}")
    for place, (tag, text) in enumerate((("title", title), ("desc", caption))):
        label = ElementTree.Element(tag, {"id": f"{name}-{tag}"})
        label.text, label.tail = text, "\n"
        root.insert(place, label)
    root.attrib = {
        "viewBox": root.attrib["viewBox"],
        "role": "img",
        "aria-labelledby": f"{name}-title",
        "aria-describedby": f"{name}-desc",
    }
    return ElementTree.tostring(root, encoding="unicode")


def _attributes(found: dict[str, str], name: str) -> Iterator[tuple[str, str]]:
    """Yield the attributes of an element with unique ids and without external links."""
    for key, value in found.items():
        if key == "id":
            yield "id", f"{name}-{value}"
        elif key == _HREF:
            if value.startswith("#"):
                yield "href", f"#{name}-{value[1:]}"
            elif value.startswith("data:image/"):
                yield "href", value
        elif not key.startswith("{"):
            yield key, re.sub(r"url\(#", f"url(#{name}-", value)
