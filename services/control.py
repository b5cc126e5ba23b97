"""``netboard control`` and ``netboard stop``: an operator's commands from a shell, and the emergency stop."""

import json as jsonlib
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError, NetboardError
from netboard.network.protocol.control import CommandName
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Json, Overrides, examples

if TYPE_CHECKING:
    from netboard.base.tables.rig import Network
    from netboard.nodes.operator.operator import Operator

app = typer.Typer()

POLL_INTERVAL_S = 0.05
"""Interval at which the keyboard is checked [s]."""


@app.command(
    epilog=examples(
        "netboard control start",
        "netboard control pause_after_trial -c rig.toml --json",
        """netboard control open '{"participant_a": "P07", "participant_b": "P08", "consent": true}'""",
        "netboard control note 'the left participant sneezed'",
        "netboard control start --until finished --seconds 900",
        "netboard control seek trial 5",
        "netboard control step back 10",
    ),
)
def control(
    command: Annotated[
        CommandName,
        typer.Argument(
            help="start: start the block. pause, pause_after_trial, resume. abort: stop this attempt and repeat it. "
            "skip: count this trial as done. repeat: add a trial at the end of the block; veto: cancel that. "
            "stop: end the block now. stop_after_block: end the session after this block. next: skip the rest of the "
            "block. end: end the session and the server. arm, disarm: allow or prevent forces. emergency_stop: set "
            "all forces to zero; emergency_release: allow forces again. open: open the session with a form as JSON. "
            "note: add a note. take: become the commander. A replay accepts play, pause, seek (12.5, trial 5 or tick "
            "900), speed 0.5, loop (on, off, trial 5, or start and end), step (ticks), next and previous (trial or "
            "another mark), and end."
        ),
    ],
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ARGUMENT...]", help="Argument of the command: a form, a note, a trial."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    take: Annotated[bool, typer.Option("--take", help="Take command from the console or another operator.")] = False,
    until: Annotated[
        Literal["idle", "levelling", "running", "holding", "paused", "finished"] | None,
        typer.Option(metavar="PHASE", help="Then wait for this phase of the trial; exit code 1 if it is not reached."),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="Timeout of --until in seconds.")] = None,
    json: Json = False,
) -> None:
    """Send a command to a running server, as the console does; for scripts."""
    settings = load(config, overrides)
    from netboard.base.process import Stopping
    from netboard.nodes.operator import shell

    network, argument = settings.network, " ".join(arguments or ())
    with shell.connected(network) as operator:
        status = shell.status_of(operator, network)
        reply = operator.do("take") if take else None
        if reply is None or reply.accepted:
            reply = shell.end(operator) if command == "end" else operator.do(command, argument)
        if command != "end":
            status = shell.status_of(operator, network)
        if reply.accepted and until is not None:
            with Stopping() as stopping:
                status = shell.wait(operator, network, until, seconds, stopping)
    if json:
        typer.echo(jsonlib.dumps({"accepted": reply.accepted, "reason": reply.reason, "status": shell.plain(status)}))
    elif not reply.accepted:
        raise NetboardError(reply.reason)
    else:
        words = reply.reason or ("the server is stopping" if command == "end" else f"the trial is {status.phase}")
        typer.echo(f"{command}: {words}")
    raise typer.Exit(0 if reply.accepted and until in (None, status.phase) else 1)


@app.command(
    epilog=examples("netboard stop", "netboard stop --guard -c rig.toml", "netboard stop --release"),
)
def stop(
    config: ConfigFile = None,
    overrides: Overrides = None,
    release: Annotated[
        bool, typer.Option("--release", help="Release the emergency stop: devices may be armed again.")
    ] = False,
    guard: Annotated[bool, typer.Option("--guard", help="Connect now, and stop when any key is pressed.")] = False,
) -> None:
    """Emergency stop: set all commanded forces to zero until it is released.

    With --guard the program is already connected and acts within a millisecond; without, it has to start first.
    """
    if release and guard:
        raise ConfigError("--release and --guard: expected one of them")
    settings = load(config, overrides)
    from rich.console import Console

    from netboard.nodes.operator import shell
    from netboard.nodes.ports import emergency

    console = Console(highlight=False)
    with shell.connected(settings.network) as operator:
        if guard and not key_pressed(operator, settings.network):
            return
        shell.carry_out(operator, settings.network, emergency.RELEASE if release else emergency.STOP)
    if release:
        console.print("The emergency stop is released. To continue: netboard control resume")
    else:
        console.print("[bold red]EMERGENCY STOP[/]: all forces are zero. To release it: netboard stop --release")


def key_pressed(operator: "Operator", network: "Network") -> bool:
    """Wait until a key is pressed; return False if the process is asked to end."""
    from netboard.base.process import Stopping
    from netboard.nodes.operator.shell import status_of
    from netboard.services.keyboard import Keyboard

    with Keyboard() as keyboard, Stopping() as stopping:
        if not keyboard.there:
            raise NetboardError("--guard: needs a terminal, because it waits for a key")
        typer.echo("Ready: press ANY KEY for the emergency stop. Ctrl-C leaves without stopping.")
        while not stopping():
            if keyboard.pressed(POLL_INTERVAL_S) is not None:
                return True
            status_of(operator, network)
    return False
