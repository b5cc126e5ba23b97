"""The code blocks of README and docs: where they are, what is run of each, and a folder in which it is run.

The blocks of a page run one after the other in one folder, as a reader would run them. An HTML comment above a block
says otherwise: `<!-- not run: REASON -->`. `<!-- file: NAME -->` says that the block is a file, which later commands
may use. Commands of other programs than those in `PROGRAMS` set up a machine and are not run, but their files in
deploy/ must exist. Commands of netboard in `NOT_RUN` are only parsed: their arguments and options are checked.
"""

import contextlib
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import typer

from netboard.services.cli import app

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
GENERATED = {"docs/reference/commands.md"}
"""Pages of help texts, which a test compares with the commands."""

FENCE = re.compile(r"^(?:<!-- ([a-z ]+): ([^\n]+) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHOWN = {"", "text", "mermaid"}
"""Languages of blocks that are no code: output, drawings and pieces of tables."""

PROGRAMS = ("netboard", "bids-validator-deno", "nwbinspector")
"""Programs whose commands are run."""

NOT_RUN = {
    r"(server|agent|logger|console|display|up|lsl|stop|status|control|demo|devices monitor)\b": "needs a session",
    r"(launch|station)\b": "starts a session",
    r"trigger\b": "needs a trigger box",
    r"replay (?!.*--(markers|verify))": "opens a window, or plays in real time",
    r"devices calibrate\b": "asks for movements of the stylus",
    r"doctor\b": "measures the machine for a minute",
    r"(bench|cohort|power|participants fit|session rehearse paper)\b": "takes minutes",
    r"trace ": "needs a recording of a live session",
    r".* --dask ": "needs other machines",
}
"""Commands of netboard that are not run, with the reason."""


@dataclass(frozen=True)
class CodeBlock:
    """One block between fences."""

    page: str
    line: int
    language: str
    text: str
    mark: str
    value: str

    @property
    def name(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """Return the shell commands, without comments; of a console block those after a prompt."""
        lines = self.text.splitlines()
        if self.language == "console":
            return [line[2:] for line in lines if line.startswith("$ ")]
        joined = re.sub(r"\\\n\s*", "", self.text)
        return [command for line in joined.splitlines() if (command := _without_comment(line))]


def _without_comment(line: str) -> str:
    return re.sub(r"(^|\s+)#.*$", "", line).strip()


def blocks() -> Iterator[CodeBlock]:
    """Return the blocks of all pages."""
    for page in PAGES:
        text, name = page.read_text(encoding="utf-8"), str(page.relative_to(ROOT))
        if name not in GENERATED:
            for found in FENCE.finditer(text):
                mark, value, language, body = (part or "" for part in found.groups())
                yield CodeBlock(name, text.count("\n", 0, found.start(3)) + 1, language, body, mark, value)


def reason_not_run(command: str) -> str | None:
    """Return why a command is not run, or nothing if it is."""
    program, _, rest = command.partition(" ")
    if program not in PROGRAMS:
        return "sets up a machine"
    found = (reason for pattern, reason in NOT_RUN.items() if re.match(pattern, rest))
    return next(found, None) if program == "netboard" else None


def require_valid(command: str, folder: Path) -> None:
    """Require of a command that is not run: its files in deploy/ exist; netboard accepts its arguments and options."""
    for path in re.findall(r"(?:^|\s)(deploy/\S+)", command):
        assert run(f"ls -d {path}", ROOT).returncode == 0, f"{path} does not exist"
    words = shlex.split(command)
    if words[0] == "netboard":
        with contextlib.chdir(folder):
            _parse(typer.main.get_command(app), words[0], words[1:], None)


def _parse(command: click.Command, name: str, words: list[str], parent: click.Context | None) -> None:
    with command.make_context(name, words, parent=parent) as context:
        if isinstance(command, click.Group):
            found, part, rest = command.resolve_command(context, [*context._protected_args, *context.args])
            assert part is not None
            _parse(part, str(found), rest, context)


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a shell command in a folder, with the commands of this environment."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "QT_QPA_PLATFORM": "offscreen", "COLUMNS": "160"}
    return subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=600
    )


def shape(text: str) -> list[str]:
    """Return the lines of an output without what differs from run to run: numbers, colours, rules and white space."""
    lines = [re.sub(r"[-+]?\d[\d.]*(e[-+]\d+)?|inf|nan", "#", line) for line in text.splitlines()]
    lines = [re.sub(r"^(green|yellow|red)\b", "COLOUR", re.sub(r"[─━]+", "─", line)) for line in lines]
    return [words for line in lines if (words := " ".join(line.split()))]


def require_output(printed: str, expected: str) -> None:
    """Require that an output has the expected lines, in their order; `...` stands for any lines."""
    lines = iter(shape(printed))
    for line in shape(expected):
        if line != "...":
            assert line in lines, f"{line!r} is not printed, or not there, in:\n{printed}"


def outputs(block: CodeBlock) -> list[tuple[str, str]]:
    """Return each command of a console block with the output that the page shows."""
    parts = re.split(r"^\$ (.*)\n", block.text, flags=re.MULTILINE)
    return list(zip(parts[1::2], parts[2::2], strict=True))
