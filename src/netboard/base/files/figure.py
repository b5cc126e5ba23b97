"""The figure that a command saves: refused before a long computation, and complete or absent after it."""

from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import new_file, refuse_existing, try_writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def refuse_figure(figure: Path | None) -> None:
    """Refuse a figure that exists already, or that cannot be drawn or saved here."""
    if figure is None:
        return
    if find_spec("matplotlib") is None:
        raise ConfigError("--figure: needs matplotlib, which is not installed: pip install 'netboard[analysis]'")
    refuse_existing(figure)
    if figure.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ConfigError(f"{figure}: expected a name that ends in .png, .svg or .pdf")
    if not figure.parent.is_dir():
        raise ConfigError(f"{figure}: cannot be written: there is no folder {figure.parent}")
    with writing(figure, NetboardError):
        try_writing(figure.parent)


def save_figure(figure: "Figure", path: Path, dpi: int) -> None:
    """Save a figure of matplotlib."""
    data = BytesIO()
    figure.savefig(data, format=path.suffix[1:].lower(), dpi=dpi)
    with new_file(path) as part:
        part.write_bytes(data.getvalue())
