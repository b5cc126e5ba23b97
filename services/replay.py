"""A recording again: in the display, as text, or verified tick by tick."""

from pathlib import Path

from rich.console import Console

from netboard.config import Side
from netboard.process import Stopping
from netboard.recording.reader import Recording
from netboard.recording.verification import verify_recording
from netboard.report.tables import verdict_line


def main(
    path: Path, *, check: bool, headless: bool, station: Side, speed: float, screenshot: Path | None = None
) -> int:
    """Replay one recording.

    Parameters
    ----------
    path : Path
        The recording.
    check : bool
        Compute every tick again and compare it to the bit; show nothing.
    headless : bool
        Tell the events as text instead of showing a window.
    station : str
        Whose view is shown.
    speed : float
        Times real time.
    screenshot : Path or None
        Save the first picture there and stop.

    Returns
    -------
    int
        Exit code: 1 if a tick is not identical.
    """
    if check:
        with Recording(path) as recording:
            verdict = verify_recording(recording)
        Console(highlight=False).print(verdict_line(verdict))
        return 0 if verdict.identical else 1
    with Stopping() as stopping:
        if headless:
            from netboard.nodes.replay import narrate

            narrate(path, speed, stopping, print)
        else:
            from netboard.display.player import run

            run(path, station, stopping, speed, screenshot)
    return 0
