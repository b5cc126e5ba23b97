"""The built-in studies, by name: that of the paper, and examples to start from.

They are TOML files inside this package, so they change only with the version of netboard.
"""

from importlib.resources import files

NAMES = ("paper", "five_forces", "controls", "pilot")
"""Names of the built-in studies."""

TEMPLATE = "template"
"""Name of the template: a study file that explains every key."""


def text_of(name: str) -> str:
    """Return the TOML text of a built-in study."""
    if name not in (*NAMES, TEMPLATE):
        raise ValueError(f"{name}: no built-in study; there are {', '.join(NAMES)}")
    return files("netboard.task.studies").joinpath(f"{name}.toml").read_text(encoding="utf-8")
