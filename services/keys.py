"""``netboard keys``: the keys of a rig.

Keys are created, listed and revoked at the server; each process gets its own. Secret keys are never shown.
"""

from pathlib import Path
from typing import Annotated

import typer

from netboard.network.protocol.joining import KeyRole
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, Side, examples

app = typer.Typer(
    name="keys",
    help="Create, list and revoke the keys by which the server authenticates its peers.",
    no_args_is_help=True,
)


def folder_of(config: Path | None, overrides: list[str] | None) -> Path:
    """Return the folder of the keys."""
    return Path(load(config, overrides).network.keys)


@app.command(epilog=examples("netboard keys init", "netboard keys init -c rig.toml"))
def init(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """Create the server's key and an empty list of authorised peers."""
    from netboard.network import keys

    path = keys.init(folder_of(config, overrides))
    typer.echo(f"{path}: created; keep it here. Create a key for each process: netboard keys add agent left")


@app.command(
    epilog=examples(
        "netboard keys add agent left", "netboard keys add display right --to carry", "netboard keys add logger"
    )
)
def add(
    role: Annotated[
        KeyRole,
        typer.Argument(
            help="Process that uses the key. console: also for netboard status, control and stop; listener: for "
            "netboard lsl; trigger: for netboard trigger; station: netboard station."
        ),
    ],
    side: Annotated[Side | None, typer.Argument(help="Side of an agent, display or station.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    to: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Folder for the new file; default: the folder of the keys.")
    ] = None,
) -> None:
    """Create and authorise the key of one process, which needs only this file."""
    from netboard.network import keys

    folder = folder_of(config, overrides)
    peer, path = keys.add(folder, role, side or "", to or folder)
    typer.echo(f"{path}: created, {keys.fingerprint(peer.public)}; move it to the computer of {peer.role_and_side}")


@app.command("list", epilog=examples("netboard keys list"))
def list_(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """List the authorised peers, and the secret keys in this folder, by their fingerprints."""
    from netboard.base.terminal.output import FittedTable, plain_console
    from netboard.network import keys

    folder = folder_of(config, overrides)
    console = plain_console()
    if (folder / keys.LIST).exists():
        table = FittedTable("name", "fingerprint", "created", "revoked", title="Authorised peers")
        for peer in keys.read_list(folder):
            revoked = f"{peer.revoked:%Y-%m-%dT%H:%MZ}" if peer.revoked else ""
            table.add_row(peer.name, keys.fingerprint(peer.public), f"{peer.created:%Y-%m-%dT%H:%MZ}", revoked)
        console.print(table)
    columns, rows = ("file", "fingerprint", "belongs to server"), keys.key_files(folder)
    console.print(FittedTable(*columns, rows=rows, title=f"Secret keys in {folder}"))


@app.command(epilog=examples("netboard keys revoke agent.left", "netboard keys revoke display.right-2"))
def revoke(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the key, as in netboard keys list.")],
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Revoke a key, from its next connection on; the server keeps running."""
    from netboard.network import keys

    peer = keys.revoke(folder_of(config, overrides), name)
    typer.echo(f"{peer.name}, {keys.fingerprint(peer.public)}: revoked; existing connections stay open")
