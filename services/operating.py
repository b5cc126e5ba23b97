"""The commands for operating a rig: status, commands, the doctor, and starting everything."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.network.protocol.control import CommandName
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides
from netboard.services.wording import examples


def status(
    config: ConfigFile = None,
    overrides: Overrides = None,
    watch: Annotated[bool, typer.Option("--watch", help="Refresh until Ctrl-C.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one line of JSON.")] = False,
) -> None:
    """Show the status of a running session and of every peer: link, round-trip time, clock, rate, losses, version."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import status as service

    raise typer.Exit(service.main(settings, watch=watch, as_json=json))


def stop(
    config: ConfigFile = None,
    overrides: Overrides = None,
    release: Annotated[
        bool, typer.Option("--release", help="Release the emergency stop: devices may be armed again.")
    ] = False,
    guard: Annotated[bool, typer.Option("--guard", help="Stand by, and stop when any key is pressed.")] = False,
) -> None:
    """Emergency stop: all commanded forces are zero until it is released.

    With --guard it is already connected, and acts within a millisecond; without, it has to start first.
    """
    if release and guard:
        raise ConfigError("--release and --guard: expected one of them, for they are opposites")
    settings = configuration.load(config, overrides or ())
    from netboard.services import control as service

    raise typer.Exit(service.emergency_stop(settings, release=release, guard=guard))


def control(
    command: Annotated[
        CommandName,
        typer.Argument(
            help="abort gives up the attempt, which begins anew; skip counts the trial as done; repeat adds a trial at "
            "the end of the block, and veto takes that back; stop ends the block; next goes on to the next one; end "
            "ends the session and the server; emergency_stop takes all forces away, and emergency_release allows them "
            "again; open takes a form as JSON; take makes this the commander. A replay knows play, pause, seek 12.5 "
            "(or trial 5, tick 900), speed 0.5, loop (on, off, trial 5, or from and to), step (ticks), next and "
            "previous (trial, or another mark), and end."
        ),
    ],
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ARGUMENT...]", help="Argument of the command: a form, a note, or a trial number."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    take: Annotated[bool, typer.Option("--take", help="Take over command from another console.")] = False,
    until: Annotated[
        Literal["idle", "levelling", "running", "holding", "paused", "finished"] | None,
        typer.Option(metavar="PHASE", help="Wait until the trial reaches this phase; exit with 1 if it does not."),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="Timeout (s).")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print reply and status as one line of JSON.")] = False,
) -> None:
    """Send a command to a running server, as the console does: for scripts."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import control as service

    raise typer.Exit(
        service.command(
            settings, command, " ".join(arguments or ()), take=take, until=until, seconds=seconds, as_json=json
        )
    )


def doctor(
    config: ConfigFile = None,
    overrides: Overrides = None,
    quick: Annotated[bool, typer.Option("--quick", help="Take seconds instead of half a minute.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the report to this file.")
    ] = None,
) -> None:
    """Check whether this machine is fit for a session, and how to fix what is not."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import doctor as service

    raise typer.Exit(service.main(settings, quick=quick, json=json))


def up(
    config: Annotated[
        Path | None,
        typer.Argument(
            metavar="CONFIG",
            help="Configuration file (TOML). Default: ./netboard.toml if present, else built-in defaults.",
        ),
    ] = None,
    station: Annotated[
        Literal["left", "right", "both"] | None, typer.Option(help="Station on this machine: its agent and display.")
    ] = None,
    server: Annotated[bool, typer.Option("--server", help="Run the server and the logger on this machine.")] = False,
    overrides: Overrides = None,
    autostart: Annotated[bool, typer.Option(help="Start the block as soon as all peers are connected.")] = True,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Accept connections from other machines without encryption.")
    ] = False,
) -> None:
    """Start all processes of this machine, supervise them, and stop them in order on Ctrl-C."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import up as service

    wanted = service.processes(
        config, overrides or (), server=server, station=station, autostart=autostart, insecure=insecure
    )
    if server:
        service.require_free(settings.network)
    raise typer.Exit(service.main(wanted))


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog=examples("netboard status", "netboard status -c rig.toml --watch", "netboard status --json"))(
        status
    )
    app.command(epilog=examples("netboard stop", "netboard stop --guard -c rig.toml", "netboard stop --release"))(stop)
    app.command(
        epilog=examples(
            "netboard control start",
            "netboard control pause_after_trial -c rig.toml --json",
            """netboard control open '{"participant_a": "P07", "participant_b": "P08", "consent": true}'""",
            "netboard control note 'the left participant sneezed'",
            "netboard control start --until finished --seconds 900",
            "netboard control seek trial 5",
            "netboard control step back 10",
        )
    )(control)
    app.command(epilog=examples("netboard doctor -c rig.toml", "netboard doctor --quick --json report.json"))(doctor)
    app.command(
        epilog=examples(
            "netboard up --server /etc/netboard/netboard.toml",
            "netboard up --station left /etc/netboard/netboard.toml",
            "netboard up --server --station both",
        )
    )(up)
