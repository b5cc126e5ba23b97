"""A recording again: in the display, on the sockets of a server, as text, or verified tick by tick."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from netboard import keys, sockets
from netboard.config import Config, Side
from netboard.process import Stopping, speak
from netboard.recording.reader import Recording
from netboard.recording.verification import verify_recording
from netboard.replay.pairing import Sync
from netboard.report.tables import marks_table, verdict_line
from netboard.services.keyboard import Keyboard

HELP = "space: play, pause   ← →: 1 s   ↑ ↓ + -: speed   , .: one tick   p n: trial   l: loop   q: end"
"""What the keys of the terminal do."""


def verify(path: Path) -> int:
    """Compute every tick of a recording again and compare it to the bit.

    Returns
    -------
    int
        Exit code: 1 if a tick is not identical.
    """
    with Recording(path) as recording:
        verdict = verify_recording(recording)
    Console(highlight=False).print(verdict_line(verdict))
    return 0 if verdict.identical else 1


def narrate(path: Path, speed: float) -> int:
    """Tell the events of a recording at the pace they happened.

    Returns
    -------
    int
        Exit code.
    """
    from netboard.nodes.replay import narrate as tell

    with Stopping() as stopping:
        tell(path, speed, stopping, print)
    return 0


def show(
    paths: Sequence[Path], station: Side, speed: float, sync: Sync, screenshot: Path | None, at: float | None
) -> int:
    """Show a recording in a window, or two of them side by side.

    Parameters
    ----------
    paths : sequence of Path
        The recordings.
    station : str
        Whose view is shown.
    speed : float
        Times real time.
    sync : str
        What two recordings have in common.
    screenshot : Path or None
        Save the first picture there and stop.
    at : float or None
        Where to begin; None for the start of the block [s].

    Returns
    -------
    int
        Exit code.
    """
    from netboard.display.player import run

    with Stopping() as stopping:
        run(paths, station, stopping, speed, screenshot, sync, at)
    return 0


def serve(path: Path, config: Config, speed: float, at: float | None) -> int:
    """Play a recording on the sockets of a server.

    Parameters
    ----------
    path : Path
        The recording.
    config : Config
        Where to listen, and who may connect: the table ``[network]``.
    speed : float
        Times real time to begin with.
    at : float or None
        Where to begin; None for the start of the block [s].

    Returns
    -------
    int
        Exit code.
    """
    from netboard.nodes.replay_server import ReplayServer, printable_line
    from netboard.replay.loading import load
    from netboard.replay.orders import KEYS

    door = keys.door(config.network)
    console = Console(highlight=False)
    reel = load(path)
    speak("replay")
    with Stopping() as stopping, sockets.open_context() as context, Keyboard() as keyboard:
        server = ReplayServer(reel, config.network, context, door, speed, at)
        console.print(f"{reel.name} is played at {config.network.bind}:{config.network.port}, as if it were live")
        if keyboard.there:
            console.print(HELP)
        server.run(
            stopping,
            lambda: KEYS.get(keyboard.pressed() or ""),
            lambda words: console.print(printable_line(words), markup=False),
        )
    return 0


def tell_marks(path: Path) -> int:
    """List the trials and events of a recording.

    Returns
    -------
    int
        Exit code.
    """
    from netboard.replay.loading import load

    Console(highlight=False).print(marks_table(load(path)))
    return 0
