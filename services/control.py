"""``netboard control``: an operator's commands from a shell."""

import json as jsonlib
import re
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

from netboard.base.errors import NetboardError
from netboard.network.protocol.control import COMMAND_HELP, CommandName
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Json, Overrides, examples

app = typer.Typer()

NEGATIVE = re.compile(r"-[0-9.]+(e[+-]?[0-9]+)?")
"""A negative number."""


class _NegativeNumbers(TyperCommand):
    """A command that takes a negative number as an argument, not as an option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Pass negative numbers on, and refuse all else that is no option."""
        ctx.ignore_unknown_options = "--" not in args and any(NEGATIVE.fullmatch(one) for one in args)
        rest = super().parse_args(ctx, args)
        for one in ctx.params["arguments"] or () if ctx.ignore_unknown_options else ():
            if one.startswith("-") and not NEGATIVE.fullmatch(one):
                ctx.fail(f"No such option: {one}")
        return rest


@app.command(
    cls=_NegativeNumbers,
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
    command: Annotated[CommandName, typer.Argument(help=COMMAND_HELP)],
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ARGUMENT...]", help="Argument of the command: a form, a note, a trial."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    take: Annotated[bool, typer.Option("--take", help="Take command from the console or another operator.")] = False,
    until: Annotated[
        Literal["idle", "levelling", "running", "holding", "paused", "finished"] | None,
        typer.Option(
            metavar="PHASE",
            help="Then wait for this phase of the trial; exit code 1 if it pauses or time runs out before.",
        ),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="Timeout of --until in seconds.")] = None,
    json: Json = False,
) -> None:
    """Send a command to a running server, as the console does; for scripts."""
    settings = load(config, overrides)
    from netboard.base.process.stopping import Stopping
    from netboard.nodes.operator import shell

    network, argument = settings.network, " ".join(arguments or ())
    with shell.connected(network) as operator:
        status = shell.status_of(operator, network)
        reply = operator.do("take") if take else None
        if reply is None or reply.accepted:
            reply = shell.end(operator) if command == "end" else operator.do(command, argument)
        after = None if command == "end" else shell.status_after(operator, network, reply)
        status = after or status
        if reply.accepted and until is not None:
            with Stopping() as stopping:
                status = shell.wait(operator, network, until, seconds, stopping)
    if json:
        typer.echo(jsonlib.dumps({"accepted": reply.accepted, "reason": reply.reason, "status": shell.plain(status)}))
    elif not reply.accepted:
        raise NetboardError(reply.reason)
    else:
        words = reply.reason or (shell.state_text(status) if after else "the server is stopping")
        typer.echo(f"{command}: {words}")
        if until not in (None, status.phase):
            raise NetboardError(f"--until {until}: was not reached; {shell.state_text(status)}")
    raise typer.Exit(0 if reply.accepted and until in (None, status.phase) else 1)
