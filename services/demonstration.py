"""The command that demonstrates netboard: a whole session on one machine, with or without players."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.config import SIDES
from netboard.base.errors import ConfigError
from netboard.base.tables.rig import MOUSE
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides
from netboard.services.wording import Dyad, examples


def demo(
    config: ConfigFile = None,
    overrides: Overrides = None,
    trials: Annotated[
        int | None, typer.Option(min=1, help="Successful trials: 6 by default; in a study, at most N in each block.")
    ] = None,
    haptics: Annotated[Literal["on", "off"], typer.Option(help="Haptic feedback on or off.")] = "on",
    bimanual: Annotated[
        bool, typer.Option("--bimanual", help="Bimanual: one simulated participant with both hands.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Random seed.")] = 1,
    directory: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the recording.")] = Path("recordings"),
    displays: Annotated[bool, typer.Option("--displays/--no-displays", help="Run the two displays.")] = True,
    play: Annotated[
        Literal["left", "right", "both"] | None,
        typer.Option(
            help="Play one side yourself with the mouse; the other side is simulated. both: mouse for the left "
            "hand, up and down keys for the right."
        ),
    ] = None,
    study: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="Run a session of a study as a pilot run, instead of one block."),
    ] = None,
    dyad: Dyad = 1,
    blocks: Annotated[int | None, typer.Option(min=1, help="Only the first N blocks of the study.")] = None,
) -> None:
    """Run a whole session on this machine, with simulated participants or with you as a player."""
    if play and not displays:
        raise ConfigError(f"--no-displays: found with --play {play}, which needs a window to play in")
    if play in SIDES and bimanual:
        raise ConfigError(f"--bimanual: found with --play {play}, expected --play both: one person moves both hands")
    settings_of = demo_settings(
        trials=trials or 6, haptics=haptics, bimanual=bimanual, seed=seed, directory=directory, play=play
    )
    if study is not None:
        settings_of.append("session.pilot=true")
    settings = configuration.load(config, [*settings_of, *(overrides or ())])
    from netboard.services import demo as service
    from netboard.services.planned import Wanted

    wanted = None if study is None else Wanted(study, dyad, 1, seed, blocks, trials)
    raise typer.Exit(service.main(settings, displays=displays, study=wanted))


def demo_settings(
    *, trials: int, haptics: str, bimanual: bool, seed: int, directory: Path, play: str | None = None
) -> list[str]:
    """Return the demo's own options as settings."""
    played = [side for side in SIDES if play in (side, "both")]
    return [
        f"block.trials={trials}",
        f"block.force={'full' if haptics == 'on' else 'none'}",
        f"block.configuration={'bimanual' if bimanual else 'dyadic'}",
        f"block.seed={seed}",
        f"recording.directory={directory}",
        *(f"agents.{side}.device={MOUSE}" for side in played),
        *(["agents.right.options.input=keys"] if play == "both" else []),
    ]


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(
        epilog=examples(
            "netboard demo",
            "netboard demo --play left",
            "netboard demo --trials 2 --haptics off --bimanual",
            "netboard demo --study paper --dyad 3 --blocks 4 --trials 5",
        )
    )(demo)
