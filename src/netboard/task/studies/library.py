"""The studies that come with netboard, by name: the paper's, and examples to start from.

Their texts are files of this package, read as its modules are; they change only with the program.
"""

from importlib.resources import files

NAMES = ("paper", "five_forces", "controls", "pilot")
"""Built-in studies."""

TEMPLATE = "template"
"""A study that says what each key is."""


def text_of(name: str) -> str:
    """Read a built-in study's file."""
    if name not in (*NAMES, TEMPLATE):
        raise ValueError(f"{name}: no built-in study; there are {', '.join(NAMES)}")
    return files("netboard.task.studies").joinpath(f"{name}.toml").read_text(encoding="utf-8")
