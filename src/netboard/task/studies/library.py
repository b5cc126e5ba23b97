"""Studies by name: those of netboard, that of the paper and examples to start from, and those of other packages.

netboard's own are TOML files inside this package, so they change only with the version of netboard. Another package
adds a study in the entry-point group ``netboard.studies``: an entry names a text in TOML.
"""

from importlib.resources import files

from netboard.base import plugins
from netboard.base.errors import ConfigError

NAMES = ("paper", "five_forces", "controls", "partners", "pilot")
"""Names of netboard's own studies."""

TEMPLATE = "template"
"""Name of the template: a study file that explains every key."""

GROUP = "netboard.studies"
"""Entry-point group of the studies of other packages."""


def names() -> tuple[str, ...]:
    """Return the names of all studies, netboard's own first."""
    return (*NAMES, *(name for name in plugins.names(GROUP, ()) if name not in NAMES))


def text_of(name: str) -> str:
    """Return the TOML text of a study; raise `ConfigError` if there is none."""
    if name in (*NAMES, TEMPLATE):
        return files("netboard.task.studies").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    text = plugins.load(GROUP, name, {}, "study", ConfigError)
    if not isinstance(text, str):
        raise ConfigError(f"the study {name!r} is {text!r}, expected a text in TOML")
    return text
