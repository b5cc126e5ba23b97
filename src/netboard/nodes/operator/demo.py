"""A demonstration: a whole session on this machine, with simulated participants or players, in real processes."""

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path

from rich.progress import MofNCompleteColumn

from netboard.base.config import SIDES, Config, played_sides, resolve
from netboard.base.errors import NetboardError
from netboard.base.process.display_server import asked_offscreen, no_screen, why_no_qt
from netboard.base.process.stopping import Stopping
from netboard.base.terminal.bars import progress_bars
from netboard.base.terminal.output import plain_console
from netboard.base.terminal.shell import shell_command
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.operator.launcher import UNBUFFERED, Launcher
from netboard.nodes.operator.operator import Operator
from netboard.nodes.operator.standstill import Standstill
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.quality_check import judged
from netboard.recording.integrity.verification import verify_recording
from netboard.recording.replay.text import summary_of, summary_tables, verification_line

SCREENSHOT_DELAY_S = 8.0
"""Time after the first view at which a display's screenshot is taken [s]."""

ANSWER_SECONDS = 0.2
SILENCE_SECONDS = 180.0
"""Time after which a server without an answer has failed: a first start compiles for minutes on a busy machine [s]."""

END_SECONDS = 20.0
WELCOME_TIMEOUT_S = 10.0
"""Time that a player who leaves waits for the server's first answer [s]."""

CLOSING_SECONDS = 3.0
"""Time for which players see that the block is over [s]."""

console = plain_console()


class BlockEnd(Enum):
    """How the supervision of a block ends."""

    FINISHED = "all trials are done"
    LEFT = "a player closed the window"
    FAILED = "interrupted, or a process has failed"


def run(
    config: Config, *, displays: bool = True, study: Sequence[str] = (), prepare: Callable[[], object] = lambda: None
) -> int:
    """Run a block, or a session of a study (``study``: options of the server), and print its results.

    ``prepare``: called once it is sure that the displays can run.

    Return 1 if a process failed, the block was not finished, or the recording is not verified. A player may leave
    before the end; that is no failure.
    """
    options = display_options(config) if displays else None
    prepare()
    began = time.monotonic()
    directory = Path(config.recording.directory).resolve()
    with Stopping() as stopping:
        try:
            directory.mkdir(parents=True, exist_ok=True)
            logs = Path(tempfile.mkdtemp(prefix=f"demo_{datetime.now(UTC):%Y%m%dT%H%M%SZ}_", dir=directory))
            session, ended = play(on_this_machine(config, directory), logs, options, stopping, study)
        except OSError as error:
            raise NetboardError(f"{directory}: cannot be written to: {error.strerror}") from error
    if ended:
        return show(directory, session, logs, began)
    for path in files_of(session, directory, ".mcap"):
        console.print(f"recording {path}", soft_wrap=True)
    for part in files_of(session, directory, ".mcap.part"):
        command = shell_command("netboard", "recover", part)
        console.print(f"unfinished recording {part}; recover it with: {command}", soft_wrap=True)
    console.print(f"logs {logs}", soft_wrap=True)
    return 1


def display_options(config: Config) -> tuple[str, ...] | None:
    """Return the options with which displays can run here, and say so if nobody sees them; None if none can run."""
    no_qt, asked = why_no_qt(), asked_offscreen()
    unseen = None if no_qt or asked else no_screen()
    if played_sides(config) and (no_qt or unseen):
        why = f"{unseen.why}; {unseen.advice}" if unseen else f"Qt cannot be loaded: {no_qt}"
        raise NetboardError(f"playing needs a window, but {why}; without players: netboard demo")
    if no_qt:
        console.print(f"running without displays, because Qt cannot be loaded: {no_qt}", style="yellow")
        return None
    if why := asked or (unseen.why if unseen else ""):
        said = f"the displays are drawn off screen, where nobody sees them: {why}"
        console.print(said, style="yellow", soft_wrap=True)
    return ("--offscreen",) if unseen else ()


def on_this_machine(config: Config, directory: Path) -> Config:
    """Restrict a configuration to this machine alone, with free ports."""
    return replace(
        config,
        network=replace(config.network, host="127.0.0.1", bind="127.0.0.1", port=free_port()),
        recording=replace(config.recording, directory=str(directory)),
    )


def play(
    config: Config, logs: Path, displays: tuple[str, ...] | None, stopping: Stopping, study: Sequence[str] = ()
) -> tuple[str, bool]:
    """Start everything, supervise it and end it in order.

    ``displays``: own options of the displays; None for no displays. Return the session's id, empty if the server never
    answered, and whether it ended without a failure.
    """
    file = logs / "demo.toml"
    file.write_text(resolve(config), encoding="utf-8")
    played = played_sides(config)
    shown = () if displays is None else played or SIDES  # a player must not look behind the curtain
    with Launcher(logs, UNBUFFERED) as launcher, sockets.open_context() as context:
        launcher.start("logger", "logger", "--once", "-c", str(file))
        launcher.start("server", "server", "-c", str(file), *study)
        for side in SIDES:
            launcher.start(f"{side} agent", "agent", "--side", side, "-c", str(file))
            if side in shown:
                picture = str(logs / f"display-{side}.png")
                options = (*(displays or ()), "--screenshot", picture, "--after", str(SCREENSHOT_DELAY_S))
                launcher.start(f"{side} display", "display", "--station", side, "-c", str(file), *options)
        operator = Operator(config.network, context)
        end = watch(operator, launcher, stopping, Standstill(logs), played=bool(played), attended=displays is not None)
        if end is BlockEnd.LEFT:
            await_server(operator)
        session = "" if operator.status is None else operator.status.session
        if end is BlockEnd.FAILED or not session:
            return session, False
        if end is BlockEnd.FINISHED and played:
            operator.attend(CLOSING_SECONDS)
        operator.command("end")
        with console.status("waiting until all records are on disk"):
            trouble = launcher.wait("server", END_SECONDS) or launcher.wait("logger", END_SECONDS)
        if trouble:
            console.print(trouble, style="red")
    return session, not trouble


def watch(
    operator: Operator,
    launcher: Launcher,
    stopping: Callable[[], bool],
    standstill: Standstill,
    *,
    played: bool,
    attended: bool,
) -> BlockEnd:
    """Show the progress until the block is over, or a player has closed the window or pressed Ctrl-C.

    ``attended``: a person may watch, so a session that stands still is reported, and does not end by itself.
    """
    answered = time.monotonic()
    with progress_bars(console, MofNCompleteColumn()) as progress:
        task = progress.add_task("starting", total=None)
        while not stopping():
            ended = launcher.ended()
            if ended is not None and played and ended.code == 0 and ended.name.endswith("display"):
                console.print("the window was closed")
                return BlockEnd.LEFT
            if ended is not None:
                console.print(str(ended), style="red")
                return BlockEnd.FAILED
            status = operator.ask(ANSWER_SECONDS)
            if status is None:
                if time.monotonic() - answered > SILENCE_SECONDS:
                    console.print(f"the server has been silent for {SILENCE_SECONDS:.0f} s", style="red")
                    return BlockEnd.FAILED
                continue
            answered = time.monotonic()
            block = f"block {status.block} of {status.blocks}, " if status.blocks > 1 else ""
            line = status.notice or f"{block}trial {status.trial}: {status.phase}, {status.failures} failed so far"
            progress.update(task, completed=status.successes, total=status.trials, description=f"{line:48.48s}")
            if status.phase == "finished" and status.block == status.blocks:
                return BlockEnd.FINISHED
            standstill.add(status, answered)
            if news := standstill.news(answered):
                console.print(news, style="yellow", soft_wrap=True)
            if not attended and (verdict := standstill.verdict(answered)):
                console.print(verdict, style="red", soft_wrap=True)
                return BlockEnd.FAILED
            time.sleep(ANSWER_SECONDS)
    if played:
        return BlockEnd.LEFT
    console.print("interrupted; all processes have been stopped")
    return BlockEnd.FAILED


def await_server(operator: Operator) -> None:
    """Wait for the server's first answer, so that a player who leaves at once still finds a whole recording."""
    until = time.monotonic() + WELCOME_TIMEOUT_S
    while operator.status is None and time.monotonic() < until:
        operator.ask(ANSWER_SECONDS)


def files_of(session: str, directory: Path, ending: str) -> list[Path]:
    """Return the files of a session, by its id in their names; none of a session without an id."""
    return sorted(directory.glob(f"*_{session[:8]}*{ending}")) if session else []


def show(directory: Path, session: str, logs: Path, began: float) -> int:
    """Print the contents of the recordings, and whether they verify."""
    paths = files_of(session, directory, ".mcap")
    if not paths:
        raise NetboardError(f"no recording of session {session[:8]} in {directory}")
    good = True
    for path in paths:
        with Recording(path) as recording:
            summary = summary_of(recording)
            verdict = verify_recording(recording)
            if len(paths) == 1:
                console.print(summary_tables(summary, recording, judged(recording)))
        console.print(verification_line(verdict))
        good &= verdict.identical and not summary.missing_ticks
        console.print(f"recording   {path}", soft_wrap=True)
    for picture in sorted(logs.glob("*.png")):
        console.print(f"screenshot  {picture}", soft_wrap=True)
    console.print(f"logs        {logs}", soft_wrap=True)
    console.print(f"took        {time.monotonic() - began:.1f} s")
    return 0 if good else 1
