"""The figure that a command saves: refused before a long computation, and complete or absent after it."""

import os
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

from netboard.base.errors import NetboardError


def refuse_figure(figure: Path | None) -> None:
    """Refuse a figure that exists already, or that cannot be drawn or saved here."""
    if figure is None:
        return
    if find_spec("matplotlib") is None:
        raise NetboardError("--figure: needs matplotlib, which is not installed: pip install 'netboard[analysis]'")
    if figure.exists():
        raise NetboardError(f"{figure}: exists already; give the figure another name")
    if figure.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise NetboardError(f"{figure}: expected a name that ends in .png, .svg or .pdf")
    if not figure.parent.is_dir():
        raise NetboardError(f"{figure}: cannot be written: there is no folder {figure.parent}")


def save_figure(figure: Any, path: Path, dpi: int) -> None:
    """Save a figure of matplotlib under a temporary name, then rename it."""
    data = BytesIO()
    figure.savefig(data, format=path.suffix[1:].lower(), dpi=dpi)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            part.write_bytes(data.getvalue())
            refuse_figure(path)
            part.rename(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise NetboardError(f"{path}: cannot be written: {error.strerror or error}") from error
