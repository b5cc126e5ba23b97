"""Device profiles: as files, and applied to a device's readings."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.devices.contract import profile
from netboard.devices.contract.device import Box, Device, DeviceInfo, Reading
from netboard.devices.contract.profile import Identity, Mechanics, Placement, Profile
from netboard.devices.simulated.virtual import VirtualTouch

SERIALS = st.text(min_size=1, max_size=16)
AMOUNTS = st.floats(0.0, 50.0)
LOW, ZERO, HIGH = st.floats(-1.0, -0.01), st.floats(-0.01, 0.01), st.floats(0.011, 1.0)
PLACEMENTS = st.builds(
    Placement,
    *(ZERO, ZERO, ZERO),
    st.floats(0.1, 10.0),
    *(LOW, LOW, LOW),
    *(HIGH, HIGH, HIGH),
    calibrated=st.text(max_size=20),
)
PROFILES = st.builds(
    Profile,
    st.builds(Identity, model=st.text(max_size=20), serial=SERIALS),
    st.builds(Mechanics, *([AMOUNTS] * 6), identified=st.text(max_size=20)),
    PLACEMENTS,
)


def writable(text: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


@given(PROFILES.filter(lambda each: writable(repr(each) + each.device.model + each.device.serial)))
def test_what_is_written_is_read_to_the_bit(known: Profile) -> None:
    from netboard.base.settings import write

    assert profile.parse(write(known), "test") == known


@given(st.lists(SERIALS.filter(writable), min_size=2, max_size=5, unique=True))
def test_every_serial_number_has_a_file_of_its_own_in_the_folder(serials: list[str]) -> None:
    folder = Path("profiles")
    files = {profile.file_of(folder, serial) for serial in serials}
    assert len(files) == len(serials)
    for file in files:
        assert file.parent == folder
        assert file.suffix == ".toml"
        assert all(letter.isascii() and (letter.isalnum() or letter in "_.-~%") for letter in file.name)


def mine(serial: str = "virtual-left", **placement: float) -> Profile:
    return Profile(Identity("virtual Touch", serial), placement=Placement(**placement))


def test_a_device_without_a_profile_has_none(tmp_path: Path) -> None:
    assert profile.load(tmp_path, "virtual-left") is None
    assert profile.load(tmp_path / "nowhere", "virtual-left") is None


def test_the_one_before_is_kept(tmp_path: Path) -> None:
    first, second = mine(zero_z=0.01), mine(zero_z=0.02)
    path = profile.save(tmp_path / "profiles", first)
    assert profile.save(tmp_path / "profiles", second) == path
    assert profile.load(tmp_path / "profiles", "virtual-left") == second
    assert profile.parse(path.with_name(f"{path.name}.bak").read_text("utf-8"), "bak") == first
    assert sorted(each.name for each in path.parent.iterdir()) == ["virtual-left.toml", "virtual-left.toml.bak"]


def test_the_one_before_is_not_kept_if_it_shall_not(tmp_path: Path) -> None:
    for z in (0.01, 0.02):
        path = profile.save(tmp_path, mine(zero_z=z), replace=True)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_the_profile_of_another_device_is_refused(tmp_path: Path) -> None:
    profile.save(tmp_path, mine("one")).rename(profile.file_of(tmp_path, "two"))
    with pytest.raises(ConfigError, match=r'two\.toml: \[device\] serial: found "one", expected "two"'):
        profile.load(tmp_path, "two")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"x_min": 0.2, "x_max": 0.1}, r"\[placement\] x_min: found 0.2, expected less than x_max, 0.1"),
        ({"zero_z": 0.2, "z_max": 0.1}, r"\[placement\] zero_z: found 0.2, expected within the workspace, -1 to 0.1"),
        ({"scale": 0.0}, r"\[placement\] scale: found 0.0, expected a number >= 0.1 and <= 10"),
        ({"y_max": 5.0}, r"\[placement\] y_max: found 5.0, expected a number >= -1 and <= 1 \[m\]"),
    ],
)
def test_a_profile_that_makes_no_sense_is_never_written(tmp_path: Path, wrong: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        profile.save(tmp_path, mine(**wrong))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "profiles").write_text("a file")
    with pytest.raises(ConfigError, match="cannot be written"):
        profile.save(tmp_path / "profiles", mine())
    with pytest.raises(ConfigError, match="cannot be read"):
        profile.load(tmp_path / "profiles", "virtual-left")


# --- a device with a profile ---------------------------------------------------------------------------------------


def rig(folder: Path, zero: float = 0.0) -> Config:
    plain = Config()
    left = replace(plain.agents.left, zero=zero, options={"held": False})
    return replace(plain, agents=replace(plain.agents, left=left, profiles=str(folder)))


class Told(Device):
    """A device that reads what it is told."""

    reading = Reading(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, True)

    def _open(self) -> DeviceInfo:
        return DeviceInfo("Told", "told", 0.0, 0.0, 0.0, Box(-0.1, -0.1, -0.1, 0.1, 0.1, 0.1))

    def _read(self, now_ns: int) -> Reading:
        return self.reading._replace(stamp_ns=now_ns)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self.last = (fx, fy, fz)

    def _close(self) -> None:
        self.closed = True


WAYS = st.floats(-0.2, 0.2)


@given(PLACEMENTS.filter(lambda p: writable(p.calibrated)), st.tuples(*[WAYS] * 6), st.floats(-0.05, 0.05))
def test_readings_come_in_the_scene_s_frame(
    tmp_path_factory: pytest.TempPathFactory, place: Placement, numbers: tuple[float, ...], lowered: float
) -> None:
    folder = tmp_path_factory.mktemp("profiles")
    profile.save(folder, Profile(Identity("Told", "told"), placement=place))
    device = Told("left", rig(folder, lowered))
    device.reading = Reading(0, *numbers, 3, True)
    with device:
        came = device.read(7)
        x, y, z, vx, vy, vz = numbers
        s = place.scale
        assert came[1:4] == pytest.approx(
            ((x - place.zero_x) * s, (y - place.zero_y) * s, (z - place.zero_z) * s - lowered), abs=1e-12
        )
        assert came[4:7] == pytest.approx((vx * s, vy * s, vz * s), abs=1e-12)
        assert came.ready == (Box(*place.box).holds(x, y, z) and max(abs(x), abs(y), abs(z)) <= 0.1)
        assert (came.stamp_ns, came.buttons) == (7, 3)
        assert device.info.details["profile_scale"] == repr(s)
    device.open(placed=False)
    assert device.read(8)[1:7] == numbers
    assert device.info.details == {}


def test_what_is_in_force_is_said(tmp_path: Path) -> None:
    known = Mechanics(0.045, 0.001, 0.1, 0.02, 0.26, 0.01, "then")
    profile.save(tmp_path, replace(mine(zero_z=0.02, scale=1.5), mechanics=known))
    with VirtualTouch("left", rig(tmp_path)) as device:
        details = device.info.details
        assert device.profile is not None
    assert details["profile_zero"] == "0.0 0.0 0.02 m"
    assert details["profile_mass"] == "0.045 +- 0.001 kg"
    assert details["profile_identified"] == "then"


def test_a_wrong_profile_leaves_the_device_closed(tmp_path: Path) -> None:
    profile.file_of(tmp_path, "told").write_text("[placement]\nscale = 0\n")
    device = Told("left", rig(tmp_path))
    with pytest.raises(ConfigError, match=r"told\.toml: \[placement\] scale"):
        device.open()
    assert device.closed
    with pytest.raises(ValueError, match="closed"):
        device.read(0)


def test_a_smaller_box_is_within_both() -> None:
    one, other = Box(-1, -2, -3, 1, 2, 3), Box(-2, -1, -1, 2, 1, 4)
    assert one.within(other) == Box(-1, -1, -1, 1, 1, 3)
    assert one.within(None) == one
