"""What a session lacks before it can start: keys and folders; found first, then created.

Each step says what is missing, and the command that does the same.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import NetboardError, writing
from netboard.base.terminal.shell import shell_command
from netboard.network import keys
from netboard.network.station_keys import STATION


@dataclass(frozen=True, slots=True)
class PreparationStep:
    """One thing that is missing."""

    what: str
    missing: str
    command: str  # that does the same
    do: Callable[[], object]


def missing_steps(config: Config, here: Sequence[Side], settings: Sequence[str]) -> Iterator[PreparationStep]:
    """Yield what is missing on the server's machine; each step must be done before the next one is asked for.

    ``here``: sides whose station is this machine. ``settings``: options with the configuration, for the commands.
    """
    yield from _missing_keys(config, here, settings)
    directory = Path(config.recording.directory)
    if not directory.is_dir():
        yield PreparationStep(
            "folder", f"{directory}: is missing", shell_command("mkdir", "-p", directory), lambda: _make(directory)
        )


def _missing_keys(config: Config, here: Sequence[Side], settings: Sequence[str]) -> Iterator[PreparationStep]:
    """Yield the keys that this machine lacks, and those of other stations that were never made."""
    encrypted, elsewhere = keys.encrypted(config.network), [side for side in SIDES if side not in here]
    if not encrypted and not elsewhere:
        return
    folder = Path(config.network.keys)
    server = keys.key_path(folder, keys.SERVER)
    if not server.exists():
        command = shell_command("netboard", "keys", "init", *settings)
        yield PreparationStep("key", f"{server}: is missing", command, lambda: keys.init(folder))
    trigger = ["trigger"] if config.triggers.declared else []
    local = ("logger", "console", *trigger, *(f"{role}.{side}" for side in here for role in ("agent", "display")))
    for peer in local if encrypted else ():
        path = keys.key_path(folder, peer)
        if not path.exists():
            yield _key_step(folder, peer, folder, f"{path}: is missing", settings)
    made = {peer.role_and_side for peer in keys.read_list(folder) if peer.revoked is None}
    for side in elsewhere:
        carried = folder.parent / f"for-{side}"
        for role in ("agent", "display", STATION) if encrypted else (STATION,):
            if (peer := f"{role}.{side}") not in made:
                missing = f"{peer} was never made; bring {carried}/*.key to the keys of that station"
                yield _key_step(folder, peer, carried, missing, settings)


def _key_step(folder: Path, peer: str, to: Path, missing: str, settings: Sequence[str]) -> PreparationStep:
    role, _, side = peer.partition(".")
    elsewhere = () if to == folder else ("--to", to)
    command = shell_command("netboard", "keys", "add", role, *([side] if side else []), *elsewhere, *settings)
    return PreparationStep("key", missing, command, lambda: keys.add(folder, role, side, to))  # type: ignore[arg-type]


def _make(folder: Path) -> None:
    with writing(folder, NetboardError):
        folder.mkdir(parents=True)
