"""``netboard replay``: shows, serves, lists or verifies a recording."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, Screenshot, Side, examples

if TYPE_CHECKING:
    from netboard.base.config import Config
    from netboard.recording.replay.loaded import LoadedRecording

app = typer.Typer()

KEYS_LINE = "space: play, pause   ← →: 1 s   ↑ ↓ + -: speed   , .: one tick   p n: trial   l: loop   q: quit"
"""Keys of a terminal that serves a replay."""


@app.command(
    epilog=examples(
        "netboard replay S01.mcap",
        "netboard replay S01.mcap S02.mcap --sync trial",
        "netboard replay S01.mcap --serve -c rig.toml",
        "netboard replay S01.mcap --markers",
        "netboard replay S01.mcap --verify",
    ),
)
def replay(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="The recording (.mcap), or two to show side by side."),
    ],
    verify: Annotated[
        bool, typer.Option("--verify", help="Recompute every tick, which must give the same bits; show nothing.")
    ] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Print the events instead of opening a window.")] = False,
    serve: Annotated[
        bool,
        typer.Option("--serve", help="Replay on the ports of a server, for displays, console and status."),
    ] = False,
    markers: Annotated[bool, typer.Option("--markers", help="List the trials and events with their times.")] = False,
    station: Annotated[Side, typer.Option(help="Seat of the participant whose view is shown.")] = "left",
    speed: Annotated[float, typer.Option(min=0.1, max=16.0, help="Speed, in multiples of real time.")] = 1.0,
    sync: Annotated[
        Literal["time", "trial"],
        typer.Option(help="Align two recordings at the start of the block, or at the start of each trial."),
    ] = "time",
    screenshot: Screenshot = None,
    at: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Start position in seconds from the recording's start.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Show a recording in the participants' display, serve it like a live session, list its events, or verify it.

    netboard control steers a served replay: play, pause, seek, speed, loop, step, next, previous. Of the configuration,
    only \[network] is used, and only with --serve.
    """
    ways = {"--verify": verify, "--headless": headless, "--serve": serve, "--markers": markers}
    chosen = [name for name, wanted in ways.items() if wanted]
    if len(chosen) > 1:
        raise ConfigError(f"{' and '.join(chosen)}: expected one of them")
    if len(recordings) > (1 if chosen else 2):
        raise ConfigError(f"replay: found {len(recordings)} recordings, expected one, or two to show side by side")
    path = recordings[0]
    from netboard.base.process import Stopping

    if verify:
        raise typer.Exit(0 if is_verified(path) else 1)
    if headless:
        from netboard.nodes.replay.replay import print_events

        with Stopping() as stopping:
            print_events(path, speed, stopping, print)
    elif markers:
        from rich.console import Console

        from netboard.recording.replay.text import marks_table

        Console(highlight=False).print(marks_table(loaded(path)))
    elif serve:
        serve_replay(path, load(config, overrides), speed, at)
    else:
        from netboard.windows.replay.player import run

        reels = [loaded(path) for path in recordings]
        with Stopping() as stopping:
            run(reels, station, stopping, speed, screenshot, sync, at)


def is_verified(path: Path) -> bool:
    """Recompute a recording, print the result, and return whether every tick is identical."""
    from rich.console import Console

    from netboard.recording.files.reader import Recording
    from netboard.recording.integrity.verification import verify_recording
    from netboard.recording.replay.text import verification_line

    with Recording(path) as recording:
        result = verify_recording(recording)
    Console(highlight=False).print(verification_line(result))
    return result.identical


def serve_replay(path: Path, config: "Config", speed: float, at: float | None) -> None:
    """Replay a recording on the ports of a server, from a position or from the start of the block [s]."""
    from rich.console import Console

    from netboard.base.process import Stopping, log_to_stderr
    from netboard.network import keys
    from netboard.network.transport import sockets
    from netboard.nodes.operator.keyboard import Keyboard
    from netboard.nodes.replay.replay_server import ReplayServer
    from netboard.nodes.server.event_log import printable_line
    from netboard.recording.replay.commands import KEYS

    authenticator = keys.make_authenticator(config.network)
    console = Console(highlight=False)
    reel = loaded(path)
    log_to_stderr("replay")
    with Stopping() as stopping, sockets.open_context() as context, Keyboard() as keyboard:
        server = ReplayServer(reel, config.network, context, authenticator, speed, at)
        console.print(f"{reel.name} is replayed at {config.network.bind}:{config.network.port}")
        if keyboard.there:
            console.print(KEYS_LINE)
        server.run(
            stopping,
            lambda: KEYS.get(keyboard.pressed() or ""),
            lambda words: console.print(printable_line(words), markup=False),
        )


def loaded(path: Path) -> "LoadedRecording":
    """Read a recording, with a progress bar on a terminal."""
    from rich.console import Console

    from netboard.base.bars import progress_bars
    from netboard.recording.replay.loading import load as load_recording

    with progress_bars(Console(stderr=True), "{task.completed} ticks") as progress:
        task = progress.add_task(f"Reading {path.name}", total=None)
        return load_recording(path, lambda ticks: progress.update(task, completed=ticks))
