"""``netboard replay``: shows, serves, lists or verifies a recording."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Insecure, Offscreen, Overrides, Screenshot, Side, examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard replay S01.mcap",
        "netboard replay S01.mcap S02.mcap --sync trial",
        "netboard replay S01.mcap --serve -c rig.toml",
        "netboard replay S01.mcap --markers",
        "netboard replay S01.mcap --verify",
        "netboard replay S01.mcap --film trial.webp --at 10 --until 16",
    )
)
def replay(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="The recording (.mcap), or two to show side by side.")
    ],
    verify: Annotated[
        bool, typer.Option("--verify", help="Recompute every tick, which must give the same bits; show nothing.")
    ] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Print the events instead of opening a window.")] = False,
    serve: Annotated[
        bool, typer.Option("--serve", help="Replay on the ports of a server, for displays, console and status.")
    ] = False,
    markers: Annotated[bool, typer.Option("--markers", help="List the trials and events with their times.")] = False,
    station: Annotated[Side, typer.Option(help="Seat of the participant whose view is shown.")] = "left",
    speed: Annotated[float, typer.Option(min=0.1, max=16.0, help="Speed, in multiples of real time.")] = 1.0,
    sync: Annotated[
        Literal["time", "trial"],
        typer.Option(help="Align two recordings at the start of the block, or at the start of each trial."),
    ] = "time",
    screenshot: Screenshot = None,
    offscreen: Offscreen = False,
    at: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Start position in seconds from the recording's start.")
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Save both displays as an animation (.webp, .gif, .png), then stop."),
    ] = None,
    until: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="End of the film in seconds from the recording's start.")
    ] = None,
    insecure: Insecure = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Show a recording in the participants' display, serve it like a live session, list its events, or verify it.

    netboard control steers a served replay: play, pause, seek, speed, loop, step, next, previous. Of the configuration,
    only \[network] is used, and only with --serve.
    """
    chosen = _given({"--verify": verify, "--headless": headless, "--serve": serve, "--markers": markers})
    window_only = {"--screenshot": screenshot is not None, "--offscreen": offscreen, "--film": film is not None}
    _refuse_contradictions(chosen, _given(window_only), at)
    _refuse_too_many(recordings, one=bool(chosen or film))
    if until is not None and film is None:
        raise ConfigError("--until: found without --film, whose end it is")
    path = recordings[0]
    if verify:
        raise typer.Exit(0 if _verify(path) else 1)
    if headless:
        _print_events(path, speed)
    elif markers:
        _list_markers(path)
    elif serve:
        from netboard.nodes.replay.replay_server import serve_recording

        serve_recording(path, load(config, overrides).network, speed, at, insecure=insecure)
    elif film is not None:
        _write_film(path, film, at, until, speed)
    else:
        _show(recordings, station, speed, screenshot, sync, at, offscreen=offscreen)


def _given(options: dict[str, bool]) -> list[str]:
    """Return the names of the options that were given."""
    return [name for name, given in options.items() if given]


def _refuse_contradictions(chosen: list[str], window_only: list[str], at: float | None) -> None:
    """Refuse options that exclude each other; ``chosen``: ways to replay other than in a window."""
    if len(chosen) > 1:
        raise ConfigError(f"{' and '.join(chosen)}: expected one of them")
    for name in window_only if chosen else ():
        raise ConfigError(f"{name}: found with {chosen[0]}, which opens no window; expected one of them")
    if chosen and chosen != ["--serve"] and at is not None:
        raise ConfigError(f"--at: found with {chosen[0]}, which begins at the start; expected one of them")


def _refuse_too_many(recordings: list[Path], *, one: bool) -> None:
    """Refuse more recordings than can be shown; ``one``: whether only one can."""
    if len(recordings) > (1 if one else 2):
        raise ConfigError(f"replay: found {len(recordings)} recordings, expected one, or two to show side by side")


def _print_events(path: Path, speed: float) -> None:
    """Print the events at the times at which they happened."""
    from netboard.base.process.stopping import Stopping
    from netboard.nodes.replay.replay import print_events

    with Stopping() as stopping:
        print_events(path, speed, stopping, print)


def _verify(path: Path) -> bool:
    """Compute every tick again, print the result, and return whether all are identical."""
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.reader import Recording
    from netboard.recording.integrity.verification import verify_recording
    from netboard.recording.replay.text import verification_line

    with Recording(path) as recording:
        result = verify_recording(recording)
    plain_console().print(verification_line(result))
    return result.identical


def _list_markers(path: Path) -> None:
    """Print the trials and events with their times."""
    from netboard.base.terminal.output import plain_console
    from netboard.recording.replay.loading import load_with_progress
    from netboard.recording.replay.text import marks_table

    plain_console().print(marks_table(load_with_progress(path)))


def _write_film(path: Path, film: Path, at: float | None, until: float | None, speed: float) -> None:
    """Save what both participants saw as an animation, which needs no screen."""
    from netboard.base.process.display_server import choose_screen
    from netboard.recording.replay.loading import load_with_progress

    choose_screen(True)
    from netboard.windows.replay.film import write_film

    write_film(load_with_progress(path), film, at or 0.0, until, speed)


def _show(
    recordings: list[Path],
    station: Side,
    speed: float,
    screenshot: Path | None,
    sync: Literal["time", "trial"],
    at: float | None,
    *,
    offscreen: bool,
) -> None:
    """Show one recording, or two side by side, in the participants' display."""
    from netboard.base.process.display_server import choose_screen
    from netboard.base.process.stopping import Stopping
    from netboard.recording.replay.loading import load_with_progress

    choose_screen(offscreen)
    from netboard.windows.replay.player import run

    loaded = [load_with_progress(path) for path in recordings]
    with Stopping() as stopping:
        run(loaded, station, stopping, speed, screenshot, sync, at)
