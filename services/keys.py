"""Keys of a rig: ``netboard keys``.

Keys are made, listed and revoked at the server; each station gets its own. Secret keys are never shown.
"""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.config import Side
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides

app = typer.Typer(
    help="Create, list and revoke the keys that authenticate the server's peers.",
    no_args_is_help=True,
)


def folder_of(config: Path | None, overrides: list[str] | None) -> Path:
    """Return the folder of the keys."""
    return Path(configuration.load(config, overrides or ()).network.keys)


@app.command(epilog="Examples:\n\n  netboard keys init\n\n  netboard keys init -c rig.toml")
def init(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """Create the server's key and an empty list of authorised peers."""
    from netboard.network import keys

    path = keys.init(folder_of(config, overrides))
    typer.echo(f"{path}: written; it stays here; make a key for each process, as in: netboard keys add agent left")


@app.command(
    epilog="Examples:\n\n  netboard keys add agent left\n\n  netboard keys add display right --to carry\n\n"
    "  netboard keys add logger"
)
def add(
    role: Annotated[
        Literal["agent", "display", "logger", "console", "listener"],
        typer.Argument(
            help="Role of the process. console: also netboard status, control and stop; listener: netboard lsl."
        ),
    ],
    side: Annotated[Side | None, typer.Argument(help="Side of an agent or display.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    to: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Folder for the key file. Default: the folder of the keys.")
    ] = None,
) -> None:
    """Create the key of one process and authorise it; the process needs only this file."""
    from netboard.network import keys

    folder = folder_of(config, overrides)
    peer, path = keys.add(folder, role, side or "", to or folder)
    typer.echo(f"{path}: written, {keys.fingerprint(peer.public)}; move it to where {peer.what} runs")


@app.command("list", epilog="Examples:\n\n  netboard keys list")
def list_(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """List the authorised peers, and the secret keys in this folder, by their fingerprints."""
    from rich.console import Console

    from netboard.base.terminal import FittedTable
    from netboard.network import keys

    folder = folder_of(config, overrides)
    console = Console(highlight=False)
    if (folder / keys.LIST).exists():
        table = FittedTable("name", "fingerprint", "created", "revoked", title="Who may connect")
        for peer in keys.read_list(folder):
            revoked = f"{peer.revoked:%Y-%m-%dT%H:%MZ}" if peer.revoked else ""
            table.add_row(peer.name, keys.fingerprint(peer.public), f"{peer.created:%Y-%m-%dT%H:%MZ}", revoked)
        console.print(table)
    table = FittedTable("file", "fingerprint", "of the server", title=f"Secret keys in {folder}")
    for row in keys.key_files(folder):
        table.add_row(*row)
    console.print(table)


@app.command(epilog="Examples:\n\n  netboard keys revoke agent.left\n\n  netboard keys revoke display.right-2")
def revoke(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the key (netboard keys list).")],
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Revoke a key, from its next connection on; the server need not be restarted."""
    from netboard.network import keys

    peer = keys.revoke(folder_of(config, overrides), name)
    typer.echo(f"{peer.name}, {keys.fingerprint(peer.public)}: revoked; who is connected with it stays until cut off")
