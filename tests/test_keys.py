"""Key files, the list of those who may connect, and who may do what with which key."""

import os
import stat
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.errors import ConfigError
from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.transport import authenticator, channels
from netboard.services.cli import app

PEERS = ("agent.left", "agent.right", "display.left", "display.right", "logger", "console", "listener")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "keys"


@pytest.fixture
def ring(folder: Path) -> keys.KeyRing:
    keys.init(folder)
    for peer in PEERS:
        role, _, side = peer.partition(".")
        keys.add(folder, role, side, folder)  # type: ignore[arg-type]
    return keys.KeyRing(folder)


def public(folder: Path, peer: str) -> str:
    return keys.credentials(folder, peer).public


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_every_file_is_for_its_owner_only_and_whole(ring: keys.KeyRing, folder: Path) -> None:
    assert mode(folder) == 0o700
    files = {path.name for path in folder.iterdir()}
    assert files == {"server.key", "authorized.toml", *(f"{peer}.key" for peer in PEERS)}
    assert {mode(path) for path in folder.iterdir()} == {0o600}
    for peer in PEERS:
        lock = keys.credentials(folder, peer)
        assert lock.public == authenticator.public_of(lock.secret)
        assert lock.server == authenticator.public_of(ring.secret)


def test_the_list_has_no_secret(ring: keys.KeyRing, folder: Path) -> None:
    text = (folder / "authorized.toml").read_text()
    assert ring.secret not in text
    for peer in PEERS:
        lock = keys.credentials(folder, peer)
        assert lock.public in text
        assert lock.secret not in text


@pytest.mark.parametrize(
    ("channel", "opened_by"),
    [
        ("motion", {"agent.left", "agent.right"}),
        ("log", {"logger", "listener"}),
        ("view.left", {"display.left", "agent.left"}),
        ("view.right", {"display.right", "agent.right"}),
        ("control", {"display.left", "display.right", "console"}),
    ],
)
def test_a_key_opens_the_channels_of_its_role_and_side(
    ring: keys.KeyRing, folder: Path, channel: str, opened_by: set[str]
) -> None:
    assert {peer for peer in PEERS if not ring.refuses(public(folder, peer), channel)} == opened_by
    assert "not known" in ring.refuses("x" * 40, channel)


def test_the_channels_with_keys_are_all_but_the_nerve() -> None:
    assert set(keys.OPENS) == set(channels.CHANNELS) - {"moves"}


def test_a_key_speaks_for_what_it_is_for(ring: keys.KeyRing, folder: Path) -> None:
    key = public(folder, "display.left")
    assert ring.owner(key) == "display.left"
    assert ring.forbids(key, "display", "left") == ""
    for role, side in (("agent", "left"), ("display", "right"), ("console", ""), ("display", "")):
        assert "the key of display.left is not that of" in ring.forbids(key, role, side)
    assert "not known" in ring.forbids("x" * 40, "display", "left")
    assert ring.owner("x" * 40) == ""


def test_a_revoked_key_is_refused_at_once_and_its_successor_let_in(
    ring: keys.KeyRing, folder: Path, tmp_path: Path
) -> None:
    key = public(folder, "agent.left")
    assert keys.revoke(folder, "agent.left").revoked is not None
    for reason in (ring.refuses(key, "motion"), ring.forbids(key, "agent", "left")):
        assert reason == "the key of agent.left has been revoked"
    peer, path = keys.add(folder, "agent", "left", tmp_path / "carry")
    assert peer.name == "agent.left-2"
    assert path == tmp_path / "carry" / "agent.left.key"
    assert ring.refuses(peer.public, "motion") == ""
    assert ring.refuses(key, "motion") != ""
    with pytest.raises(ConfigError, match=r"no key agent\.left to revoke; valid keys: agent\.right, .*agent\.left-2"):
        keys.revoke(folder, "agent.left")


@pytest.mark.parametrize("text", ["no TOML at all", "[[peer]]\nname = 1\n", "other = 1\n", "[[peer]]\nname = 'a'\n"])
def test_with_a_broken_list_nobody_is_let_in_until_it_is_mended(ring: keys.KeyRing, folder: Path, text: str) -> None:
    path, key = folder / "authorized.toml", public(folder, "agent.left")
    good = path.read_text()
    path.write_text(text)
    assert "authorized.toml: " in ring.refuses(key, "motion")
    assert "authorized.toml: " in ring.forbids(key, "agent", "left")
    path.unlink()
    assert ring.refuses(key, "motion") != ""
    path.write_text(good)
    path.chmod(0o644)
    assert "chmod 600" in ring.refuses(key, "motion")
    path.chmod(0o600)
    assert ring.refuses(key, "motion") == ""


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('role = "logger"', 'role = "agent"', "logger: role agent and side '' do not go together"),
        ('role = "logger"', 'role = "king"', "role"),
        ('side = "left"', 'side = "middle"', "side"),
        ("created = 2", "created = ", "not valid TOML"),
        ('public = "', 'public = "_', "public"),
    ],
)
def test_an_impossible_list_is_refused(ring: keys.KeyRing, folder: Path, old: str, new: str, problem: str) -> None:
    path = folder / "authorized.toml"
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=problem):
        keys.KeyRing(folder)


def test_the_same_key_twice_is_refused(ring: keys.KeyRing, folder: Path) -> None:
    path = folder / "authorized.toml"
    text = path.read_text()
    path.write_text(text + text[text.index("[[peer]]") :])
    with pytest.raises(ConfigError, match="twice"):
        keys.KeyRing(folder)


@pytest.mark.skipif(os.name != "posix", reason="no modes")
@pytest.mark.parametrize(("name", "loose", "proper"), [("", 0o750, "700"), ("agent.left.key", 0o640, "600")])
def test_what_others_can_read_is_refused_with_what_to_do(
    ring: keys.KeyRing, folder: Path, name: str, loose: int, proper: str
) -> None:
    path = folder / name if name else folder
    path.chmod(loose)
    with pytest.raises(ConfigError) as caught:
        keys.credentials(folder, "agent.left")
    assert str(caught.value) == f"{path}: is accessible to other users (mode {loose:04o}); do: chmod {proper} {path}"


def test_nothing_is_ever_overwritten(ring: keys.KeyRing, folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(ConfigError, match=r"server\.key: already exists and was not changed"):
        keys.init(folder)
    with pytest.raises(ConfigError, match=r"agent\.left\.key: already exists and was not changed"):
        keys.add(folder, "agent", "left", folder)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_two_do_not_change_the_list_at_once(ring: keys.KeyRing, folder: Path) -> None:
    (folder / "authorized.toml.new").touch(0o600)
    with pytest.raises(ConfigError, match=r"authorized\.toml\.new: already exists"):
        keys.revoke(folder, "logger")
    assert (folder / "authorized.toml.new").exists()


def test_a_lost_key_file_is_said_with_what_to_do(folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"display\.right\.key: does not exist; .*keys add display right, and"):
        keys.credentials(folder, "display.right")
    with pytest.raises(ConfigError, match=r"server\.key: does not exist; make it with: netboard keys init"):
        keys.KeyRing(folder)


def test_a_file_that_holds_no_key_is_refused(ring: keys.KeyRing, folder: Path) -> None:
    path = folder / "agent.left.key"
    path.write_text(path.read_text().replace('secret = "', 'secret = "_'))
    with pytest.raises(ConfigError, match=r"agent\.left\.key: secret"):
        keys.credentials(folder, "agent.left")
    with pytest.raises(ConfigError, match="has no key of the server"):
        keys.credentials(folder, "server")


@pytest.mark.parametrize(
    ("role", "side", "problem"), [("agent", "", "expected a side"), ("logger", "left", "has no side")]
)
def test_a_side_is_for_those_who_have_one(folder: Path, role: keys.Role, side: str, problem: str) -> None:
    keys.init(folder)
    with pytest.raises(ConfigError, match=problem):
        keys.add(folder, role, side, folder)


@pytest.mark.parametrize(
    ("settings", "on"),
    [
        ({}, False),
        ({"bind": "0.0.0.0"}, True),
        ({"host": "10.0.0.1"}, True),
        ({"host": "localhost", "bind": "127.0.0.2"}, False),
        ({"host": "server.lab"}, True),
        ({"host": "10.0.0.1", "transport": "ipc"}, False),
        ({"transport": "ipc", "curve": "on"}, True),
        ({"bind": "0.0.0.0", "curve": "off"}, False),
        ({"curve": "on"}, True),
    ],
)
def test_keys_are_in_use_where_another_machine_can_be_reached(settings: dict[str, str], on: bool) -> None:
    assert keys.encrypted(Network(**settings)) is on  # type: ignore[arg-type]


def test_addresses_carry_the_keys_where_they_are_in_use(ring: keys.KeyRing, folder: Path) -> None:
    network = Network(bind="0.0.0.0", keys=str(folder))
    lock = keys.reach(network, "agent.left").reach(channels.MOTION).lock
    assert lock == keys.credentials(folder, "agent.left")
    assert keys.make_authenticator(network) is not None
    off = replace(network, curve="off")
    assert keys.reach(off, "agent.left").reach(channels.MOTION).lock is None
    assert keys.make_authenticator(off) is None


@pytest.mark.parametrize(
    ("network", "refused"),
    [
        (Network(), False),
        (Network(bind="0.0.0.0"), False),
        (Network(bind="0.0.0.0", curve="off"), True),
        (Network(bind="0.0.0.0", curve="off", transport="ipc"), False),
        (Network(host="10.0.0.1", curve="off"), False),
    ],
)
def test_an_open_address_without_keys_must_be_asked_for(network: Network, refused: bool) -> None:
    if refused:
        with pytest.raises(ConfigError, match="--insecure"):
            keys.refuse_open_network(network)
    else:
        keys.refuse_open_network(network)


class TestCommands:
    @pytest.fixture(autouse=True)
    def here(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)

    def run(self, *words: str, code: int = 0) -> str:
        result = CliRunner().invoke(app, ["keys", *words], env={"COLUMNS": "120"})
        assert result.exit_code == code, result.output
        return result.output

    def test_a_rig_gets_its_keys(self) -> None:
        assert "server.key: created" in self.run("init")
        assert "agent.left.key: created" in self.run("add", "agent", "left")
        assert "carry/logger.key: created" in self.run("add", "logger", "--to", "carry")
        listed = self.run("list")
        assert keys.fingerprint(public(Path("keys"), "agent.left")) in listed
        assert keys.credentials(Path("keys"), "agent.left").secret not in listed
        assert "revoked" in self.run("revoke", "agent.left")
        assert keys.read_list(Path("keys"))[0].revoked is not None

    def test_a_station_lists_what_it_has(self) -> None:
        self.run("init")
        self.run("add", "agent", "left", "--to", "station")
        listed = self.run("list", "--set", "network.keys=station")
        assert "agent.left.key" in listed
        assert "Authorised peers" not in listed

    def test_mistakes_are_one_line(self) -> None:
        assert self.run("revoke", "nobody", code=2).count("\n") == 1
        assert self.run("add", "display", code=2).count("\n") == 1
        assert "king" in self.run("add", "king", code=2)
