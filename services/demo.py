"""``netboard demo``: a whole session on one machine, with or without players."""

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load, load_study
from netboard.services.options import (
    MOST_SEED,
    MOST_TRIALS,
    Blocks,
    ConfigFile,
    Dyad,
    Overrides,
    RobotPartnerName,
    SessionOf,
    examples,
    partner_settings,
    refuse_without_study,
)
from netboard.services.up import blocks_of_session

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard demo",
        "netboard demo --play left",
        "netboard demo --play left --partner robot",
        "netboard demo --trials 2 --haptics off --bimanual",
        "netboard demo --study paper --dyad 3 --blocks 4 --trials 5",
    )
)
def demo(
    context: typer.Context,
    config: ConfigFile = None,
    overrides: Overrides = None,
    trials: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_TRIALS, help="Successful trials; default: 6, or those of the study's blocks."),
    ] = None,
    haptics: Annotated[Literal["on", "off"], typer.Option(help="Haptic feedback.")] = "on",
    bimanual: Annotated[bool, typer.Option("--bimanual", help="One simulated participant with both hands.")] = False,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Random seed.")] = 1,
    directory: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the recording.")] = Path("recordings"),
    displays: Annotated[bool, typer.Option("--displays/--no-displays", help="Show the participants' displays.")] = True,
    play: Annotated[
        Literal["left", "right", "both"] | None,
        typer.Option(
            help="Play one side with the mouse; the other is simulated. both: the mouse moves the left end, the up "
            "and down keys the right end."
        ),
    ] = None,
    partner: RobotPartnerName = None,
    study: SessionOf = None,
    dyad: Dyad = 1,
    blocks: Blocks = None,
) -> None:
    """Run a whole session on this machine, with simulated participants or with you as a player."""
    refuse_without_study(context, study, "dyad", "blocks")
    if play and not displays:
        raise ConfigError(f"--no-displays: found with --play {play}, which needs a window to play in")
    if play in ("left", "right") and bimanual:
        raise ConfigError(f"--bimanual: found with --play {play}, expected --play both: one person moves both hands")
    if partner and (bimanual or play == "both"):
        raise ConfigError(f"--partner: found {partner}, expected none where one person moves both hands")
    demo_options = demo_settings(
        trials=trials or 6, haptics=haptics, bimanual=bimanual, seed=seed, directory=directory, play=play
    )
    seat = "left" if play == "right" else "right"
    if partner and (named := [one for one in overrides or () if one.startswith(f"block.{seat}=")]):
        raise ConfigError(f"--partner: found {partner} beside --set {named[-1]}, expected one of both")
    demo_options += partner_settings(seat, partner)
    if study is not None:
        load_study(study)  # refused before any process starts
        demo_options.append("session.pilot=true")
    settings = load(config, [*demo_options, *(overrides or ())], "the options of netboard demo")
    from netboard.base.config import SIDES
    from netboard.nodes.launching.kernels import compile_kernels
    from netboard.nodes.operator.demo import run
    from netboard.nodes.server.planned import StudySession

    wanted = None if study is None else StudySession(study, dyad, 1, seed, blocks, trials)
    planned = blocks_of_session(settings, wanted)
    options = [] if wanted is None else [*wanted.options, "--autostart"]
    prepare = partial(compile_kernels, settings, planned, SIDES)
    raise typer.Exit(run(settings, displays=displays, study=options, prepare=prepare))


def demo_settings(
    *, trials: int, haptics: str, bimanual: bool, seed: int, directory: Path, play: str | None = None
) -> list[str]:
    """Return the demo's own options as settings."""
    from netboard.base.tables.rig import MOUSE
    from netboard.base.tables.triggers import NO_BOX

    played = [side for side in ("left", "right") if play in (side, "both")]
    return [
        f"block.trials={trials}",
        f"block.force={'full' if haptics == 'on' else 'none'}",
        f"block.configuration={'bimanual' if bimanual else 'dyadic'}",
        f"block.seed={seed}",
        f"recording.directory={directory}",
        f"triggers.kind={NO_BOX}",  # the demo starts no process for a box, and the server would wait for it
        *(f"agents.{side}.device={MOUSE}" for side in played),
        *(["agents.right.options.input=keys"] if play == "both" else []),
    ]
