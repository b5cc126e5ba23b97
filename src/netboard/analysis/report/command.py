"""Insertion of the command line into an analysis folder, last, because all other files do not depend on it."""

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from markupsafe import escape

from netboard.analysis.report.wording import visible

PLACEHOLDER = "@command-of-this-analysis@"
"""Placeholder for the command until then; a command word with this text is left as it is."""


def name_command(folder: Path, command: Sequence[str]) -> None:
    """Write the command into provenance and report."""
    text = shlex.join(command)
    written = {"provenance.json": json.dumps(text, ensure_ascii=False)[1:-1], "report.html": str(escape(visible(text)))}
    for name, shown in written.items():
        path = folder / name
        path.write_bytes(path.read_bytes().replace(PLACEHOLDER.encode(), shown.encode()))
