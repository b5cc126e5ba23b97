"""The keys of a rig, which say who may connect in which role.

A folder (network.keys) holds them, with mode 0700 and files of mode 0600; looser modes are refused. The server's folder
has its own secret key, ``server.key``, and ``authorized.toml``: the public key of every peer, with its one role and
side. A station's folder has a file for each process, named after its role and side (``agent.left.key``), with the
peer's own secret key and the server's public key. A key opens the channels of its role and side. A revoked key opens
nothing from the next handshake on, because the server reads the list again whenever it changes. Only the list is ever
overwritten.
"""

import hashlib
import ipaddress
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Annotated, Literal, TypeAlias, TypeVar

from pydantic import AwareDatetime, Field, TypeAdapter, ValidationError

from netboard.base.config import SIDES
from netboard.base.errors import ConfigError, writing
from netboard.base.files.new import write_synced
from netboard.base.files.text import read_text
from netboard.base.settings import FORBID_UNKNOWN_KEYS, parse_toml, to_toml
from netboard.base.system.ownership import PRIVATE_FILE, PRIVATE_FOLDER, why_open
from netboard.base.tables.rig import Network
from netboard.network.protocol.joining import KEY_ROLES_WITH_SIDE, KeyRole, role_and_side
from netboard.network.transport import authenticator, channels

OPENS: dict[str, tuple[str, ...]] = {
    "motion": ("agent.left", "agent.right"),
    "log": ("logger", "listener"),
    "view.left": ("display.left", "agent.left"),
    "view.right": ("display.right", "agent.right"),
    "partner.left": ("agent.left",),
    "partner.right": ("agent.right",),
    "control": ("display.left", "display.right", "console", "trigger"),
}
"""Roles whose keys open each channel. An agent gets its station's view for the simulated participant at it."""

SERVER = "server"
HOW_TO_INIT = "make it with: netboard keys init"
CUT_OFF = "the file is cut off, or not a key file of netboard: copy it again"
LIST = "authorized.toml"
LIST_HEAD = "# Who may connect to this server: public keys, each for one role and side. Written by: netboard keys\n"

Z85Key: TypeAlias = Annotated[str, Field(pattern=r"^[0-9a-zA-Z.:+=^!/*?&<>()\[\]{}@%$#-]{40}$")]
"""A Z85 encoding of 32 bytes."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class KeyedPeer:
    """A peer's entry in the server's list."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    name: str  # role and side, numbered from the second key on
    role: KeyRole
    side: Literal["left", "right", ""]
    public: Z85Key
    created: AwareDatetime
    revoked: AwareDatetime | None = None

    @property
    def role_and_side(self) -> str:
        """Role and side, as in ``agent.left``."""
        return role_and_side(self.role, self.side)


@dataclass(frozen=True, slots=True)
class _List:
    """Contents of ``authorized.toml``."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    peer: tuple[KeyedPeer, ...] = ()


@dataclass(frozen=True, slots=True)
class _KeyFile:
    """Contents of a secret key's file; a peer's also has the server's public key."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    name: str
    created: AwareDatetime
    secret: Z85Key
    server: Z85Key | None = None


# --- use of keys -------------------------------------------------------------------------------------------------


def encrypted(network: Network) -> bool:
    """Return whether keys are in use: as configured, or with ``auto`` whenever other machines can connect."""
    if network.curve == "auto":
        return network.transport == "tcp" and not (local(network.host) and local(network.bind))
    return network.curve == "on"


def local(address: str) -> bool:
    """Return whether no other machine can reach an address."""
    try:
        return ipaddress.ip_address(address.strip("[]")).is_loopback
    except ValueError:
        return address == "localhost"


def refuse_open_network(network: Network) -> None:
    """Refuse an address that other machines can reach without encryption."""
    if network.transport == "tcp" and not local(network.bind) and not encrypted(network):
        raise ConfigError(
            f'[network] bind: found "{network.bind}", which other machines can reach, with curve = "{network.curve}"; '
            'expected curve = "auto" and keys (netboard keys init). On an isolated network, add --insecure'
        )


def reach(network: Network, peer: str) -> channels.Addresses:
    """Return the server's addresses for a peer, with its keys if they are in use."""
    lock = credentials(Path(network.keys), peer) if encrypted(network) else None
    return channels.addresses(network, lock)


def make_authenticator(network: Network) -> authenticator.Authenticator | None:
    """Make the authenticator of a server; None if keys are not in use."""
    return authenticator.Authenticator(KeyRing(Path(network.keys)), network.port) if encrypted(network) else None


def credentials(folder: Path, peer: str) -> authenticator.Credentials:
    """Read a peer's keys."""
    path = key_path(folder, peer)
    role, _, side = peer.partition(".")
    hint = f"create it on the server's machine with: netboard keys add {role} {side}".rstrip() + ", and bring it here"
    file = _read_key(path, hint)
    if file.server is None:
        raise ConfigError(f"{path}: has no key of the server; {CUT_OFF}, or move it away and {hint}")
    return authenticator.Credentials(authenticator.public_of(file.secret), file.secret, file.server)


class KeyRing:
    """The server's own key, and the role of each peer's key as the files say now."""

    def __init__(self, folder: Path) -> None:
        self.secret = _read_key(key_path(folder, SERVER), HOW_TO_INIT).secret
        self._list = folder / LIST
        self._stamp: tuple[int, int, int] | None = None
        self._peers: dict[str, KeyedPeer] = {}
        self._problem = ""
        self._reread()
        if self._problem:
            raise ConfigError(self._problem)

    def channel_refusal(self, key: str, channel: str) -> str:
        """Return why a key may not open a channel; empty if it may."""
        peer, reason = self._find(key)
        if peer is None or reason:
            return reason
        return "" if peer.role_and_side in OPENS[channel] else f"the key of {peer.name} is not for this channel"

    def role_refusal(self, key: str, role: str, side: str) -> str:
        """Return why the owner of a key may not act in this role and side; empty if it may."""
        peer, reason = self._find(key)
        if peer is None or reason:
            return reason
        wanted = role_and_side(role, side)
        return "" if peer.role_and_side == wanted else f"the key of {peer.name} is not that of {wanted}"

    def owner(self, key: str) -> str:
        """Return the role and side of a key, such as ``agent.left``; empty if the key is unknown."""
        peer = self._peers.get(key)
        return peer.role_and_side if peer else ""

    def fingerprint(self, key: str) -> str:
        """Return the fingerprint of a public key."""
        return fingerprint(key)

    def _find(self, key: str) -> tuple[KeyedPeer | None, str]:
        """Return the owner of a key, and why the key is invalid; empty if it is valid."""
        self._reread()
        peer = self._peers.get(key)
        if self._problem:
            return peer, self._problem
        if peer is None:
            return None, "its key is not known here"
        return peer, f"the key of {peer.name} has been revoked" if peer.revoked else ""

    def _reread(self) -> None:
        """Read the list again if it has changed; an invalid list admits nobody."""
        try:
            found = self._list.stat()
            stamp = (found.st_mtime_ns, found.st_ino, found.st_size)
            if stamp != self._stamp:
                self._peers = {peer.public: peer for peer in read_list(self._list.parent)}
                self._stamp = stamp
            self._problem = ""
        except OSError as error:
            self._problem = f"{self._list}: {error.strerror}"
        except ConfigError as error:
            self._problem = str(error)


# --- management of keys ------------------------------------------------------------------------------------------


def init(folder: Path) -> Path:
    """Make a server's key and an empty list of peers."""
    _make_folder(folder)
    _refuse_open(folder)
    path = key_path(folder, SERVER)
    _write_key(path, _KeyFile(SERVER, _now(), authenticator.new_keys()[1]))
    if not (folder / LIST).exists():
        _write_new(folder / LIST, LIST_HEAD)
    return path


def add(folder: Path, role: KeyRole, side: str, to: Path) -> tuple[KeyedPeer, Path]:
    """Make a peer's key and authorise it. ``to``: folder for its file; created if missing."""
    if (role in KEY_ROLES_WITH_SIDE) != (side in SIDES):
        raise ConfigError(f"{role}: expected a side, left or right" if not side else f"{role}: has no side")
    server = _read_key(key_path(folder, SERVER), HOW_TO_INIT)
    with ExitStack() as undo:
        with _changed_list(folder) as peers:
            taken = {peer.name for peer in peers}
            names = (role_and_side(role, side) + (f"-{number}" if number > 1 else "") for number in count(1))
            name = next(name for name in names if name not in taken)
            public, secret = authenticator.new_keys()
            peer = KeyedPeer(name, role, side, public, _now())  # type: ignore[arg-type]
            _make_folder(to)
            path = key_path(to, peer.role_and_side)
            _write_key(path, _KeyFile(name, peer.created, secret, authenticator.public_of(server.secret)))
            undo.callback(path.unlink)  # a key that is not listed opens nothing
            peers.append(peer)
        undo.pop_all()
    return peer, path


def revoke(folder: Path, name: str) -> KeyedPeer:
    """Revoke a peer's key."""
    with _changed_list(folder) as peers:
        valid = [peer for peer in peers if peer.revoked is None]
        peer = next((peer for peer in valid if peer.name == name), None)
        if peer is None:
            names = ", ".join(peer.name for peer in valid) or "none"
            raise ConfigError(f"{folder / LIST}: there is no key {name} to revoke; valid keys: {names}")
        revoked = peers[peers.index(peer)] = replace(peer, revoked=_now())
        return revoked


def read_list(folder: Path) -> tuple[KeyedPeer, ...]:
    """Read the list of peers."""
    path = folder / LIST
    peers = _parse(path, _read(path, HOW_TO_INIT), _LIST_ADAPTER).peer
    for peer in peers:
        if (peer.role in KEY_ROLES_WITH_SIDE) != (peer.side in SIDES):
            raise ConfigError(
                f"{path}: {peer.name}: role {peer.role} and side {peer.side!r} are not a valid combination"
            )
    if len({peer.public for peer in peers}) < len(peers):
        raise ConfigError(f"{path}: the same key is listed twice")
    return peers


def key_files(folder: Path) -> list[tuple[str, str, str]]:
    """List the secret keys in a folder.

    Returns for each file: its name, the fingerprint of its key, and that of its server's key (empty for a server's own
    file).
    """
    found = []
    for path in sorted(folder.glob("*.key")):
        file = _read_key(path, "")
        server = fingerprint(file.server) if file.server else ""
        found.append((path.name, fingerprint(authenticator.public_of(file.secret)), server))
    return found


def require_keys(network: Network) -> None:
    """Refuse keys that a server or a peer here would refuse; a folder that is not there yet has none."""
    folder = Path(network.keys)
    if not encrypted(network) or not folder.exists():
        return
    if not folder.is_dir():
        raise ConfigError(f"[network] keys: {folder}: is not a folder")
    _refuse_open(folder)
    key_files(folder)
    if (folder / LIST).exists():
        read_list(folder)


def fingerprint(public: str) -> str:
    """Return the fingerprint of a public key: the beginning of its SHA-256."""
    digest = hashlib.sha256(public.encode()).hexdigest()
    return "-".join(digest[at : at + 4] for at in range(0, 16, 4))


def key_path(folder: Path, name: str) -> Path:
    """Return the path of a key's file."""
    return folder / f"{name}.key"


# --- files -------------------------------------------------------------------------------------------------------


@contextmanager
def _changed_list(folder: Path) -> Iterator[list[KeyedPeer]]:
    """Lock the list for a change, and write it at the end, completely or not at all."""
    new = folder / f"{LIST}.new"
    _write_new(new, "", "already exists: another command is changing the list; if none is running, remove this file")
    try:
        peers = list(read_list(folder))
        yield peers
        with writing(folder / LIST, ConfigError):
            write_synced(new, _list_text(peers))
            new.replace(folder / LIST)
    finally:
        new.unlink(missing_ok=True)


def _list_text(peers: Iterable[KeyedPeer]) -> str:
    return LIST_HEAD + "".join(
        f"\n[[peer]]\nname = {to_toml(peer.name)}\nrole = {to_toml(peer.role)}\nside = {to_toml(peer.side)}\n"
        f"public = {to_toml(peer.public)}\ncreated = {peer.created.isoformat()}\n"
        + (f"revoked = {peer.revoked.isoformat()}\n" if peer.revoked else "")
        for peer in peers
    )


def _make_folder(folder: Path) -> None:
    """Make a folder that only its owner can read, if it is missing."""
    with writing(folder):
        folder.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)


def _write_key(path: Path, file: _KeyFile) -> None:
    _write_new(
        path,
        f"# A secret key of netboard: keep it secret, and copy it only to the machine that runs {file.name}.\n"
        f"name = {to_toml(file.name)}\ncreated = {file.created.isoformat()}\nsecret = {to_toml(file.secret)}\n"
        + (f"server = {to_toml(file.server)}\n" if file.server else ""),
    )


def _write_new(path: Path, text: str, existing: str = "already exists and was not changed; move it away first") -> None:
    """Write a new file that only its owner can read; ``existing``: end of the error message if it exists already."""
    try:
        path.touch(mode=PRIVATE_FILE, exist_ok=False)
        try:
            path.write_text(text, encoding="utf-8", newline="\n")
        except BaseException:
            path.unlink(missing_ok=True)
            raise
    except FileExistsError:
        raise ConfigError(f"{path}: {existing}") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error


def _read_key(path: Path, hint: str) -> _KeyFile:
    text = _read(path, hint)
    try:
        file = _parse(path, text, _KEY_ADAPTER)
        authenticator.public_of(file.secret)
    except ConfigError as error:
        raise ConfigError(f"{error}; {CUT_OFF}, or move it away and {hint}") from None
    except ValueError:
        raise ConfigError(f"{path}: secret: is not a key; {CUT_OFF}, or move it away and {hint}") from None
    return file


def _read(path: Path, hint: str) -> str:
    """Read a file that only its owner may read."""
    text = read_text(path, f"does not exist; {hint}")
    for place in (path.parent, path):
        _refuse_open(place)
    return text


def _refuse_open(path: Path) -> None:
    """Refuse a file or folder that other users may read or change."""
    if why := why_open(path):
        raise ConfigError(f"{path}: {why}")


def _parse(path: Path, text: str, adapter: TypeAdapter[T]) -> T:
    try:
        return adapter.validate_python(parse_toml(text, str(path)))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        problem = "is missing" if first["type"] == "missing" else first["msg"]
        raise ConfigError(f"{path}: {'.'.join(str(step) for step in first['loc'])}: {problem}") from None


def _now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)


_LIST_ADAPTER = TypeAdapter(_List)
_KEY_ADAPTER = TypeAdapter(_KeyFile)
