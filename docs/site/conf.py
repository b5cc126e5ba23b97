"""Settings of the documentation site, which Sphinx builds from the pages of the repository: `make site`.

The source folder is the root of the repository, so that a relative link means the same on the site and on the
repository's pages. `contents` makes the tables of contents, `source_pages` the pages of linked source files.
"""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path
from types import GenericAlias
from typing import Any

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))

project = "netboard"
author = "the netboard contributors"
copyright = "the netboard contributors, BSD-3-Clause"  # noqa: A001 - Sphinx looks for this name
release = version = installed_version("netboard")

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc", "sphinx_copybutton", "contents", "source_pages"]
root_doc = "docs/README"
include_patterns = ["docs/**", "*.md", "changes/README.md", "src/**/*.md"]
exclude_patterns = ["docs/site"]
suppress_warnings = ["misc.highlighting_failure"]  # mermaid and csv have no lexer; their blocks are shown as text

linkcheck_timeout = 20  # [s]
linkcheck_retries = 2
linkcheck_anchors = False  # many hosts make them by scripts, which it does not run
linkcheck_ignore = [r"http://(127\.0\.0\.1|localhost)"]  # examples
linkcheck_allow_unauthorized = True  # a page that asks for a login is there
linkcheck_report_timeouts_as_broken = False

myst_heading_anchors = 4
nb_execution_mode = "off"  # a test runs the notebook

autodoc_typehints = "none"  # the docstrings give types with shapes
add_module_names = False
toc_object_entries_show_parents = "hide"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "pydata_sphinx_theme"
html_title = "netboard"
html_static_path = ["_static"]
html_css_files = ["netboard.css"]
html_additional_pages = {"index": "index.html"}
templates_path = ["_templates"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_toc_level": 1,
    "navigation_with_keys": False,
    "pygments_light_style": "tango",
    "pygments_dark_style": "github-dark",
}


def skip_alias(app: Sphinx, kind: str, name: str, obj: object, skip: bool, options: Any) -> bool | None:
    """Leave out aliases of types: numpydoc would read the docstring of the built-in type for them."""
    return True if isinstance(obj, GenericAlias) else None


def setup(app: Sphinx) -> None:
    """Register the filter of documented names."""
    app.connect("autodoc-skip-member", skip_alias)
