"""Key files, the list of authorised peers, and what each key permits."""

import os
import stat
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.errors import ConfigError
from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.protocol.joining import Role
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


@pytest.mark.skipif(os.name != "posix", reason="no modes")
def test_key_files_are_complete_and_readable_by_the_owner_only(ring: keys.KeyRing, folder: Path) -> None:
    assert mode(folder) == 0o700
    files = {path.name for path in folder.iterdir()}
    assert files == {"server.key", "authorized.toml", *(f"{peer}.key" for peer in PEERS)}
    assert {mode(path) for path in folder.iterdir()} == {0o600}
    for peer in PEERS:
        lock = keys.credentials(folder, peer)
        assert lock.public == authenticator.public_of(lock.secret)
        assert lock.server == authenticator.public_of(ring.secret)


def test_authorised_list_contains_no_secret_keys(ring: keys.KeyRing, folder: Path) -> None:
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
def test_key_opens_the_channels_of_its_role_and_side(
    ring: keys.KeyRing, folder: Path, channel: str, opened_by: set[str]
) -> None:
    assert {peer for peer in PEERS if not ring.channel_refusal(public(folder, peer), channel)} == opened_by
    assert "not known" in ring.channel_refusal("x" * 40, channel)


def test_all_channels_except_moves_have_keys() -> None:
    assert set(keys.OPENS) == set(channels.CHANNELS) - {"moves"}


def test_key_is_bound_to_its_role_and_side(ring: keys.KeyRing, folder: Path) -> None:
    key = public(folder, "display.left")
    assert ring.owner(key) == "display.left"
    assert ring.role_refusal(key, "display", "left") == ""
    for role, side in (("agent", "left"), ("display", "right"), ("console", ""), ("display", "")):
        assert "the key of display.left is not that of" in ring.role_refusal(key, role, side)
    assert "not known" in ring.role_refusal("x" * 40, "display", "left")
    assert ring.owner("x" * 40) == ""


def test_revoked_key_is_refused_at_once_and_its_successor_accepted(
    ring: keys.KeyRing, folder: Path, tmp_path: Path
) -> None:
    key = public(folder, "agent.left")
    assert keys.revoke(folder, "agent.left").revoked is not None
    for reason in (ring.channel_refusal(key, "motion"), ring.role_refusal(key, "agent", "left")):
        assert reason == "the key of agent.left has been revoked"
    peer, path = keys.add(folder, "agent", "left", tmp_path / "carry")
    assert peer.name == "agent.left-2"
    assert path == tmp_path / "carry" / "agent.left.key"
    assert ring.channel_refusal(peer.public, "motion") == ""
    assert ring.channel_refusal(key, "motion") != ""
    with pytest.raises(ConfigError, match=r"no key agent\.left to revoke; valid keys: agent\.right, .*agent\.left-2"):
        keys.revoke(folder, "agent.left")


@pytest.mark.parametrize("text", ["no TOML at all", "[[peer]]\nname = 1\n", "other = 1\n", "[[peer]]\nname = 'a'\n"])
def test_broken_list_refuses_everybody_until_repaired(ring: keys.KeyRing, folder: Path, text: str) -> None:
    path, key = folder / "authorized.toml", public(folder, "agent.left")
    good = path.read_text()
    path.write_text(text)
    assert "authorized.toml: " in ring.channel_refusal(key, "motion")
    assert "authorized.toml: " in ring.role_refusal(key, "agent", "left")
    path.unlink()
    assert ring.channel_refusal(key, "motion") != ""
    path.write_text(good)
    path.chmod(0o600)
    assert ring.channel_refusal(key, "motion") == ""


@pytest.mark.skipif(os.name != "posix", reason="no modes")
def test_list_that_others_can_read_refuses_everybody(ring: keys.KeyRing, folder: Path) -> None:
    path = folder / "authorized.toml"
    path.write_text(path.read_text() + "\n")
    path.chmod(0o644)
    assert "chmod 600" in ring.channel_refusal(public(folder, "agent.left"), "motion")


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('role = "logger"', 'role = "agent"', "logger: role agent and side '' are not a valid combination"),
        ('role = "logger"', 'role = "king"', "role"),
        ('side = "left"', 'side = "middle"', "side"),
        ("created = 2", "created = ", "not valid TOML"),
        ('public = "', 'public = "_', "public"),
    ],
)
def test_invalid_list_is_refused(ring: keys.KeyRing, folder: Path, old: str, new: str, problem: str) -> None:
    path = folder / "authorized.toml"
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=problem):
        keys.KeyRing(folder)


def test_duplicate_key_is_refused(ring: keys.KeyRing, folder: Path) -> None:
    path = folder / "authorized.toml"
    text = path.read_text()
    path.write_text(text + text[text.index("[[peer]]") :])
    with pytest.raises(ConfigError, match="twice"):
        keys.KeyRing(folder)


@pytest.mark.skipif(os.name != "posix", reason="no modes")
@pytest.mark.parametrize(("name", "loose", "proper"), [("", 0o750, "700"), ("agent.left.key", 0o640, "600")])
def test_files_accessible_to_others_are_refused_with_the_chmod_command(
    ring: keys.KeyRing, folder: Path, name: str, loose: int, proper: str
) -> None:
    path = folder / name if name else folder
    path.chmod(loose)
    with pytest.raises(ConfigError) as caught:
        keys.credentials(folder, "agent.left")
    assert str(caught.value) == f"{path}: is accessible to other users (mode {loose:04o}); do: chmod {proper} {path}"


def test_key_files_are_never_overwritten(ring: keys.KeyRing, folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(ConfigError, match=r"server\.key: already exists and was not changed"):
        keys.init(folder)
    with pytest.raises(ConfigError, match=r"agent\.left\.key: already exists and was not changed; move it away first"):
        keys.add(folder, "agent", "left", folder)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_new_key_never_takes_the_name_of_another(folder: Path) -> None:
    """A name twice in the list would be revoked once, and the other key would stay valid."""
    keys.init(folder)
    for number in range(3):
        keys.add(folder, "agent", "left", folder / f"to-{number}")
    path = folder / "authorized.toml"
    head, first, _, third = path.read_text().split("[[peer]]")
    path.write_text("[[peer]]".join((head, first, third)))  # an operator has deleted agent.left-2
    keys.add(folder, "agent", "left", folder / "to-3")
    assert [peer.name for peer in keys.read_list(folder)] == ["agent.left", "agent.left-3", "agent.left-2"]


def test_concurrent_change_of_the_list_is_refused(ring: keys.KeyRing, folder: Path) -> None:
    (folder / "authorized.toml.new").touch(0o600)
    with pytest.raises(
        ConfigError, match=r"authorized\.toml\.new: already exists.*if none is running, remove this file"
    ):
        keys.revoke(folder, "logger")
    assert (folder / "authorized.toml.new").exists()


@pytest.mark.skipif(os.name != "posix", reason="no limits")
def test_full_disk_leaves_no_key_that_is_not_listed(ring: keys.KeyRing, folder: Path, tmp_path: Path) -> None:
    """A limit of the kernel, below the length of the list and above that of a key, replaces the full disk."""
    import resource

    before = {path: path.read_bytes() for path in folder.iterdir()}
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (600, limits[1]))
    try:
        with pytest.raises(ConfigError, match=r"authorized\.toml: cannot be written: File too large"):
            keys.add(folder, "agent", "left", tmp_path / "carry")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    assert list((tmp_path / "carry").iterdir()) == []


def test_missing_key_file_is_reported_with_the_command_to_make_it(folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"display\.right\.key: does not exist; .*keys add display right, and"):
        keys.credentials(folder, "display.right")
    with pytest.raises(ConfigError, match=r"server\.key: does not exist; make it with: netboard keys init"):
        keys.KeyRing(folder)


def test_file_without_a_valid_key_is_refused(ring: keys.KeyRing, folder: Path) -> None:
    path = folder / "agent.left.key"
    path.write_text(path.read_text().replace('secret = "', 'secret = "_'))
    with pytest.raises(ConfigError, match=r"agent\.left\.key: secret"):
        keys.credentials(folder, "agent.left")
    with pytest.raises(ConfigError, match="has no key of the server"):
        keys.credentials(folder, "server")


@pytest.mark.parametrize("share", [0.0, 0.2, 0.55, 0.7, 0.8, 0.95])
def test_key_file_that_is_cut_off_says_so_and_what_to_do(ring: keys.KeyRing, folder: Path, share: float) -> None:
    path = folder / "agent.left.key"
    text = path.read_text()
    path.write_text(text[: int(share * len(text))])
    said = r"agent\.left\.key: .*cut off, .*copy it again, .*keys add agent left"
    with pytest.raises(ConfigError, match=said) as found:
        keys.credentials(folder, "agent.left")
    assert "Field required" not in str(found.value)


@pytest.mark.parametrize(
    ("role", "side", "problem"), [("agent", "", "expected a side"), ("logger", "left", "has no side")]
)
def test_side_is_required_or_forbidden_by_the_role(folder: Path, role: Role, side: str, problem: str) -> None:
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
def test_encryption_is_on_if_another_machine_can_be_reached(settings: dict[str, str], on: bool) -> None:
    assert keys.encrypted(Network(**settings)) is on  # type: ignore[arg-type]


def test_addresses_carry_the_keys_if_encryption_is_on(ring: keys.KeyRing, folder: Path) -> None:
    network = Network(bind="0.0.0.0", keys=str(folder))
    lock = keys.reach(network, "agent.left").reach(channels.MOTION).security
    assert lock == keys.credentials(folder, "agent.left")
    assert keys.make_authenticator(network) is not None
    off = replace(network, curve="off")
    assert keys.reach(off, "agent.left").reach(channels.MOTION).security is None
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
def test_open_address_without_keys_needs_the_insecure_option(network: Network, refused: bool) -> None:
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

    def test_keys_are_created_added_listed_and_revoked(self) -> None:
        assert "server.key: created" in self.run("init")
        assert "agent.left.key: created" in self.run("add", "agent", "left")
        assert f"{Path('carry/logger.key')}: created" in self.run("add", "logger", "--to", "carry")
        listed = self.run("list")
        assert keys.fingerprint(public(Path("keys"), "agent.left")) in listed
        assert keys.credentials(Path("keys"), "agent.left").secret not in listed
        assert "revoked" in self.run("revoke", "agent.left")
        assert keys.read_list(Path("keys"))[0].revoked is not None

    def test_station_lists_only_its_own_keys(self) -> None:
        self.run("init")
        self.run("add", "agent", "left", "--to", "station")
        listed = self.run("list", "--set", "network.keys=station")
        assert "agent.left.key" in listed
        assert "Authorised peers" not in listed

    def test_errors_are_reported_in_one_line(self) -> None:
        assert self.run("revoke", "nobody", code=2).count("\n") == 1
        assert self.run("add", "display", code=2).count("\n") == 1
        assert "king" in self.run("add", "king", code=2)
