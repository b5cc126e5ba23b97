"""``netboard devices list``: the connected devices, and the available backends."""

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, Json, Overrides, examples

app = typer.Typer()


@app.command("list", epilog=examples("netboard devices list", "netboard devices list --json"))
def list_(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the connected devices by serial number, whether they can be opened, and the available backends."""
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    raise typer.Exit(commands.show_list(settings, as_json=json))
