"""The command in the folder of an analysis: written in last, because all else there is the same whoever asked."""

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from markupsafe import escape

from netboard.analysis.report.wording import visible

PLACEHOLDER = "@command-of-this-analysis@"
"""What stands for it until then; as a word of a command it is left as it is."""


def name_command(folder: Path, command: Sequence[str]) -> None:
    """Write the words of the command into provenance and report."""
    text = shlex.join(command)
    written = {"provenance.json": json.dumps(text, ensure_ascii=False)[1:-1], "report.html": str(escape(visible(text)))}
    for name, shown in written.items():
        path = folder / name
        path.write_bytes(path.read_bytes().replace(PLACEHOLDER.encode(), shown.encode()))
