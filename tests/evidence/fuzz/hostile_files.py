"""``make evidence ARGS=files``: recordings, journals, tables and keys that are well formed, and lie.

`lies` makes the files; with ``--quick``, a sample of them, and a minute of commands. A command that opens one runs in a
process of its own. It must end in bounded time and memory with an exit code that it documents, without a traceback, and
say in plain lines what is wrong. Unlike damage (`make evidence ARGS=recovery`), no checksum reveals such a file.
Commands share their readers, so they take turns: each file goes to one or more, and each command gets files of each
kind; `analyse`, which takes ten times as long as any other, gets one of each.
"""

import os
import re
import resource
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from evidence.fuzz.lies import KINDS, Case, cases, unchanged, written
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run

MAX_SECONDS, MAX_MB = 60.0, 700.0
"""Longest time on the processor of a command [s], and largest memory beyond that of one that does nothing [MB]."""

PATIENCE = 10
"""How many times as long a command may take by the clock, on a machine that has other work [1]."""

EACH = 1
"""Fewest commands that each file goes to [1]."""

QUICK_FILES, QUICK_COMMANDS = 2, 2
"""Files of each kind, and commands for each, in the short form [1]."""

JOBS = 2
"""Commands that run at the same time [1]."""

Command = Callable[[Path, Path], list[str]]
"""Makes the arguments of a command, of the file and a new output."""


def _export(form: str) -> Command:
    return lambda file, out: ["export", str(file), "--to", form, "-o", str(out)]


ANALYSE = "analyse"
COMMANDS: dict[str, Command] = {
    "check": lambda file, out: ["check", str(file)],
    "check --verify": lambda file, out: ["check", str(file), "--verify"],
    "info": lambda file, out: ["info", str(file)],
    "replay --verify": lambda file, out: ["replay", str(file), "--verify"],
    **{f"export {form}": _export(form) for form in ("csv", "parquet", "mat", "bids", "nwb", "xdf")},
    ANALYSE: lambda file, out: ["analyse", str(file), "-o", str(out), "--workers", "1"],
    "recover": lambda file, out: ["recover", str(file), "-o", str(out.with_suffix(".mcap"))],
    "trace": lambda file, out: ["trace", str(file)],
    "whatif": lambda file, out: ["whatif", str(file), "--set", "physics.k_h=400"],
    "sessions": lambda file, out: ["sessions", str(file.parent)],
    "sessions --check": lambda file, out: ["sessions", str(file.parent), "--check"],
}
"""Commands that open a recording."""

FOLDER_COMMANDS: dict[str, Command] = {
    "sessions": COMMANDS["sessions"],
    "sessions --check": COMMANDS["sessions --check"],
    "check FOLDER": lambda file, out: ["check", str(file.parent)],
    "recover FOLDER": lambda file, out: ["recover", str(file.parent), "-o", str(out)],
    "export FOLDER": lambda file, out: ["export", str(file.parent), "--to", "csv", "-o", str(out)],
    "analyse FOLDER": lambda file, out: ["analyse", str(file.parent), "-o", str(out), "--workers", "1"],
}
HAND_COMMANDS: dict[str, Command] = {
    "simulate": lambda file, out: ["simulate", "-i", str(file), "-o", str(out / "result.csv")],
    "import": lambda file, out: ["import", str(file), "-o", str(out)],
    "import --simulate": lambda file, out: [
        *("import", str(file), "--simulate", "-o", str(out), "--map", "time=t"),
        *("--map", "left_z=z_left", "--map", "right_z=z_right"),
    ],
}
KEY_COMMANDS: dict[str, Command] = {
    "keys list": lambda file, out: ["keys", "list", "-c", str(file)],
    "keys add": lambda file, out: ["keys", "add", "console", "-c", str(file)],
    "keys revoke": lambda file, out: ["keys", "revoke", "agent.left", "-c", str(file)],
    "config check": lambda file, out: ["config", "check", str(file)],
}
OTHER_COMMANDS: dict[str, dict[str, Command]] = {
    "folder": FOLDER_COMMANDS,
    "table of ticks": {"import": HAND_COMMANDS["import"]},
    "table of hands": HAND_COMMANDS,
    "keys": KEY_COMMANDS,
}
"""Commands for kinds of files other than recordings."""

DOCUMENTED = {"check": (0, 1, 3), "sessions": (0, 1, 2, 3), "replay": (0, 1, 2)}
"""Exit codes of commands that print a result, and may end with 1 then; of others 0 clean, 1 a fault, 2 wrong input."""

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


@dataclass(frozen=True)
class Result:
    """How a command ended for a file."""

    case: Case
    command: str
    code: int
    seconds: float
    memory_mb: float
    stdout: str
    stderr: str

    @property
    def fault(self) -> str:
        """What the command did wrong; empty if nothing."""
        first = self.command.partition(" ")[0]
        if self.code not in DOCUMENTED.get(first, (0, 1, 2)):
            return f"exit code {self.code} after {self.seconds:.0f} s"
        if "Traceback" in self.stdout + self.stderr:
            return "a traceback"
        lines = self.stderr.rstrip("\n").splitlines()
        if self.code and not lines and first not in DOCUMENTED:
            return "no word on stderr"
        if len(lines) > 20 + (self.case.kind == "folder") * 400 or max(map(len, lines), default=0) > 2000:
            return f"{len(lines)} lines of up to {max(map(len, lines))} characters on stderr"
        if _CONTROL.search(self.stderr) or "\x1b[2J" in self.stdout:
            return "control characters on the terminal"
        return "" if self.memory_mb < MAX_MB else f"{self.memory_mb:.0f} MB"

    @property
    def words(self) -> str:
        """The fault in words: file, command, what happened, and the last line that the command printed."""
        last = ((self.stderr or self.stdout).strip().splitlines() or [""])[-1]
        return f"{self.case.kind}, {self.case.name}, {self.command}: {self.fault}: {last:.200}"


# --- running commands ------------------------------------------------------------------------------------------------


def commands_for(kind: str) -> dict[str, Command]:
    """Return the commands that open files of a kind."""
    return OTHER_COMMANDS.get(kind, COMMANDS)


def turns(kind: str, files: Sequence[Case], *, quick: bool) -> Iterator[tuple[Case, str]]:
    """Yield which command gets which file: in turn, so that each command gets at least one."""
    commands = commands_for(kind)
    names = [name for name in commands if not name.startswith(ANALYSE)]
    each = QUICK_COMMANDS if quick else min(len(names), max(EACH, -(-len(names) // len(files))))
    first = 5 * list(KINDS).index(kind)
    for number, case in enumerate(files):
        for k in range(each):
            yield case, names[(first + number * each + k) % len(names)]
    for name in [] if quick else commands.keys() - names:
        yield files[-1], name


@dataclass
class _Running:
    """A command in its process."""

    case: Case
    command: str
    place: Path
    began: float


def _start(case: Case, command: str, place: Path) -> int:
    """Make a file in a new folder and start a command on it; return the number of the process."""
    place.mkdir()
    file = case.make(place)
    child = os.fork()
    if not child:
        _become(commands_for(case.kind)[command](file, place / "out"), place)
    return child


def _become(argv: list[str], place: Path) -> None:
    """Run a command in this new process and end it."""
    from netboard.services.cli import app

    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_CPU, (round(MAX_SECONDS), round(MAX_SECONDS)))
    code = 99
    for name, number in (("stdout", 1), ("stderr", 2)):
        os.dup2(os.open(place.with_suffix(f".{name}"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))
    try:
        app(argv)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:  # noqa: BLE001 - a traceback is what this looks for
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _ended(running: dict[int, _Running]) -> tuple[int, int, resource.struct_rusage]:
    """Wait for a process of these, and kill those that wait for ever."""
    while True:
        child, status, used = os.wait4(-1, os.WNOHANG)
        if child:
            return child, os.waitstatus_to_exitcode(status), used
        for number, one in running.items():
            if time.perf_counter() - one.began > MAX_SECONDS * PATIENCE:
                os.killpg(number, signal.SIGKILL)
        time.sleep(0.005)


def results_of(planned: Sequence[tuple[Case, str]], scratch: Path, tell: Tell, jobs: int = JOBS) -> Iterator[Result]:
    """Run commands on files, some at a time, and yield how each ended."""
    baseline_mb = _memory_of_nothing()
    running: dict[int, _Running] = {}
    waiting = list(enumerate(planned))[::-1]
    while waiting or running:
        while waiting and len(running) < jobs:
            number, (case, command) = waiting.pop()
            place = scratch / f"case-{number}"
            running[_start(case, command, place)] = _Running(case, command, place, time.perf_counter())
        child, code, used = _ended(running)
        one = running.pop(child)
        said = [one.place.with_suffix(f".{name}") for name in ("stdout", "stderr")]
        texts = [name.read_text(encoding="utf-8", errors="replace") for name in said]
        seconds, memory_mb = used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3 - baseline_mb
        result = Result(one.case, one.command, code, seconds, memory_mb, *texts)
        if result.fault:
            tell(result.words, 0)
        yield result
        for path in said:
            path.unlink()
        shutil.rmtree(one.place)


def _memory_of_nothing() -> float:
    """Return the memory of a process that does nothing [MB]."""
    child = os.fork()
    if not child:
        os._exit(0)
    return os.wait4(child, 0)[2].ru_maxrss / 1e3


def warm_up(scratch: Path, *, quick: bool) -> None:
    """Run every command on the recording without lies in this process, which then has its modules and kernels loaded.

    Each must find it clean.
    """
    from netboard.services.cli import app

    place = scratch / "sound"
    place.mkdir()
    file = written(unchanged)(place)
    for command, argv in COMMANDS.items():
        if quick and command == ANALYSE:
            continue
        said = StringIO()
        with redirect_stdout(said), redirect_stderr(said):
            try:
                app(argv(file, place / f"out {command}"))
            except SystemExit as end:
                if end.code:
                    raise SystemExit(f"{command}: exit code {end.code} for a sound file: {said.getvalue()}") from None


# --- tables ----------------------------------------------------------------------------------------------------------


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the commands on the files and tabulate how they ended."""
    planned = [turn for kind in KINDS for turn in turns(kind, cases(kind, QUICK_FILES if quick else None), quick=quick)]
    tell(f"{len({id(case) for case, _ in planned})} files, {len(planned)} commands", 0)
    found = []
    with TemporaryDirectory() as scratch:
        warm_up(Path(scratch), quick=quick)
        for result in results_of(planned, Path(scratch), tell):
            found.append(result)
            if len(found) % 100 == 0:
                tell(f"{len(found)} of {len(planned)} commands", len(found) / len(planned))
    yield table(found, "files", "what lies", lambda one: one.case.kind)
    part = table(found, "commands", "command", lambda one: one.command)
    faults = [one.words for one in found if one.fault]
    part.claim(
        f"every command ends within {MAX_SECONDS:g} s and {MAX_MB:g} MB, without a traceback, and says what is wrong",
        not faults,
        f"{len(faults)} faults, such as {faults[0]}" if faults else f"no fault in {len(found)} commands",
    )
    yield part


def table(found: Sequence[Result], name: str, heading: str, key: Callable[[Result], str]) -> ResultPart:
    """Tabulate results by a property of theirs."""
    part = ResultPart(
        f"hostile-{name}",
        "Files that lie about themselves, and how the commands that opened them ended",
        f"{heading} | files [1] | commands [1] | read [1] | refused, and said so [1] | faults [1] | longest [s] | "
        "most memory [MB]",
    )
    for word in dict.fromkeys(map(key, found)):
        own = [one for one in found if key(one) == word]
        refused = sum(one.code in (1, 2) and not one.fault for one in own)
        faults = sum(bool(one.fault) for one in own)
        worst = (round(max(one.seconds for one in own), 1), round(max(one.memory_mb for one in own)))
        files = len({id(one.case) for one in own})
        part.add(word, files, len(own), len(own) - refused - faults, refused, faults, *worst)
    return part


def main(options: Options) -> int:
    """Run the commands on hostile files; return 1 if one failed a requirement."""
    # Without a bar: its thread would hold locks while the commands' processes are forked.
    return 0 if all(verdict.holds for verdict in run("files", study, options, bar=False)) else 1
