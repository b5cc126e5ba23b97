"""The commands that start the processes of a rig: their options, but not their implementation."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides
from netboard.services.wording import Dyad, Screenshot, examples

SessionNumber = Annotated[int, typer.Option("--session", min=1, help="Number of the session in the dyad's plan.")]


def server(
    config: Annotated[
        list[Path] | None,
        typer.Option(
            "--config",
            "-c",
            metavar="FILE",
            help="Configuration file (TOML). Default: ./netboard.toml if present, else built-in defaults. Repeat "
            "for further dyads, each on the port in its file.",
        ),
    ] = None,
    overrides: Overrides = None,
    autostart: Annotated[
        bool | None,
        typer.Option(
            "--autostart/--no-autostart",
            help="Start each block as soon as all peers are connected. Default for a single block; in a study the "
            "operator starts each block (netboard console).",
        ),
    ] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Accept connections from other machines without encryption.")
    ] = False,
    study: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Run a session of this study (netboard plan list).")
    ] = None,
    dyad: Dyad = 1,
    session: SessionNumber = 1,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the study's plan.")] = 1,
    blocks: Annotated[int | None, typer.Option(min=1, help="Pilot runs: only the first N blocks.")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="Pilot runs: at most N trials in each block.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume the session where it was interrupted.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Resume without asking.")] = False,
) -> None:
    """Run the physics server: it simulates the board and runs the trials, of one dyad or of several."""
    files: list[Path | None] = [*(config or (None,))]
    settings = [configuration.load(file, overrides or ()) for file in files]
    if not insecure:
        for one in settings:
            refuse_open_network(one)
    if study is None and resume:
        raise ConfigError("--resume: expected the --study that is resumed: a single block is not")
    if study is not None and len(settings) > 1:
        raise ConfigError(f"--study: found with {len(settings)} files, expected one: each dyad of a study has a server")
    from netboard.services import server as service

    if study is None:
        raise typer.Exit(service.main(settings, autostart=autostart is not False))
    from netboard.services.planned import Wanted

    wanted = Wanted(study, dyad, session, seed, blocks, trials)
    raise typer.Exit(service.study(settings[0], wanted, autostart=autostart is True, resume=resume, yes=yes))


def refuse_open_network(config: Config) -> None:
    """Refuse an address that other machines can reach if nothing is encrypted."""
    from netboard.network.keys import encrypted, local

    network = config.network
    if network.transport == "tcp" and not local(network.bind) and not encrypted(network):
        raise ConfigError(
            f'[network] bind: found "{network.bind}", which other machines can reach, with curve = "{network.curve}": '
            'leave that to "auto" and make keys (netboard keys init), or, on a network of your own, start the server '
            "with --insecure"
        )


def agent(
    side: Annotated[Side, typer.Option(help="The hand this device is for.")],
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Run a haptic agent, one for each device: it reads the stylus, renders the force and limits it safely."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import agent as service

    raise typer.Exit(service.main(settings, side=side))


def display(
    station: Annotated[Side | None, typer.Option(help="Station whose view is shown.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    screenshot: Screenshot = None,
    after: Annotated[
        float | None,
        typer.Option(
            min=0, metavar="SECONDS", help="Take the screenshot this long after the first view, and keep running."
        ),
    ] = None,
    offscreen: Annotated[bool, typer.Option("--offscreen", help="Run without a screen (offscreen rendering).")] = False,
    list_screens: Annotated[bool, typer.Option("--list-screens", help="List this machine's screens and stop.")] = False,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Measure the pixel size of the screen with a bank card.")
    ] = False,
) -> None:
    """Run a participant's display: board, ball, target and the participant's own stylus."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import display as service

    if list_screens:
        raise typer.Exit(service.list_screens())
    if calibrate:
        raise typer.Exit(service.calibrate(settings))
    if station is None:
        raise ConfigError("--station: not given, expected left or right")
    raise typer.Exit(service.main(settings, station=station, screenshot=screenshot, after=after, offscreen=offscreen))


def console(
    config: ConfigFile = None,
    overrides: Overrides = None,
    screenshot: Screenshot = None,
    after: Annotated[
        float | None,
        typer.Option(
            min=0, metavar="SECONDS", help="Take the screenshot this long after the first status, and keep running."
        ),
    ] = None,
    offscreen: Annotated[bool, typer.Option("--offscreen", help="Run without a screen (offscreen rendering).")] = False,
) -> None:
    """Open the operator's console: show the status, open the session, run it, stop it."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import console as service

    raise typer.Exit(service.main(settings, screenshot=screenshot, after=after, offscreen=offscreen))


def logger(
    config: ConfigFile = None,
    overrides: Overrides = None,
    once: Annotated[bool, typer.Option("--once", help="Stop after one session.")] = False,
) -> None:
    """Run the logger: it writes every tick and event to a recording."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import logger as service

    raise typer.Exit(service.main(settings, once=once))


def lsl(
    config: ConfigFile = None,
    overrides: Overrides = None,
    name: Annotated[
        str, typer.Option(help="Prefix of the stream names; use a different one for each dyad in the room.")
    ] = "netboard",
) -> None:
    """Send board, hands, forces and events to the Lab Streaming Layer (for LabRecorder) while sessions run."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import lsl as service

    raise typer.Exit(service.main(settings, name))


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(
        epilog=examples(
            "netboard server",
            "netboard server -c rig.toml --no-autostart",
            "netboard server -c rig.toml --study paper --dyad 3",
            "netboard server -c rig.toml --study paper --dyad 3 --resume",
            "netboard server -c a.toml -c b.toml",
        )
    )(server)
    app.command(epilog=examples("netboard agent --side left", "netboard agent --side right -c rig.toml"))(agent)
    app.command(
        epilog=examples(
            "netboard display --station left",
            "netboard display --station right --offscreen --screenshot r.png",
            "netboard display --calibrate --set display.screen=1",
        )
    )(display)
    app.command(
        epilog=examples("netboard console", "netboard console -c rig.toml", "netboard console --screenshot c.png")
    )(console)
    app.command(epilog=examples("netboard logger", "netboard logger --set recording.directory=/data --once"))(logger)
    app.command(epilog=examples("netboard lsl -c rig.toml", "netboard lsl -c b.toml --name pair2"))(lsl)
