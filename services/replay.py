"""Replays a recording in the display, on the sockets of a server or as text, or verifies it tick by tick."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from netboard.base.config import Config, Side
from netboard.base.process import Stopping, speak
from netboard.network import keys
from netboard.network.transport import sockets
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.loading import load
from netboard.recording.replay.pairing import Sync
from netboard.recording.replay.text import marks_table, verification_line
from netboard.services.keyboard import Keyboard

HELP = "space: play, pause   ← →: 1 s   ↑ ↓ + -: speed   , .: one tick   p n: trial   l: loop   q: end"
"""The terminal's keys."""


def verify(path: Path) -> int:
    """Recompute every tick of a recording and compare it to the bit."""
    with Recording(path) as recording:
        result = verify_recording(recording)
    Console(highlight=False).print(verification_line(result))
    return 0 if result.identical else 1


def narrate(path: Path, speed: float) -> int:
    """Print the events of a recording at the original pace."""
    from netboard.nodes.replay.replay import narrate as tell

    with Stopping() as stopping:
        tell(path, speed, stopping, print)
    return 0


def show(
    paths: Sequence[Path], station: Side, speed: float, sync: Sync, screenshot: Path | None, at: float | None
) -> int:
    """Show a recording in a window, or two of them side by side.

    Parameters
    ----------
    at : float or None
        Where to begin; None for the start of the block [s].
    """
    from netboard.windows.replay.player import run

    recordings = [loaded(path) for path in paths]
    with Stopping() as stopping:
        run(recordings, station, stopping, speed, screenshot, sync, at)
    return 0


def serve(path: Path, config: Config, speed: float, at: float | None) -> int:
    """Replay a recording on the sockets of a server.

    Parameters
    ----------
    at : float or None
        Where to begin; None for the start of the block [s].
    """
    from netboard.nodes.replay.replay_server import ReplayServer, printable_line
    from netboard.recording.replay.commands import KEYS

    door = keys.door(config.network)
    console = Console(highlight=False)
    recording = loaded(path)
    speak("replay")
    with Stopping() as stopping, sockets.open_context() as context, Keyboard() as keyboard:
        server = ReplayServer(recording, config.network, context, door, speed, at)
        console.print(f"{recording.name} is played at {config.network.bind}:{config.network.port}, as if it were live")
        if keyboard.there:
            console.print(HELP)
        server.run(
            stopping,
            lambda: KEYS.get(keyboard.pressed() or ""),
            lambda words: console.print(printable_line(words), markup=False),
        )
    return 0


def tell_marks(path: Path) -> int:
    """List the trials and events of a recording."""
    Console(highlight=False).print(marks_table(loaded(path)))
    return 0


def loaded(path: Path) -> LoadedRecording:
    """Read a recording, with a progress bar on a terminal."""
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed} ticks"), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(f"Reading {path.name}", total=None)
        return load(path, lambda ticks: progress.update(task, completed=ticks))
