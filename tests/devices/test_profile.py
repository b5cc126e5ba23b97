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
    st.builds(Mechanics, st.floats(1e-9, 50.0), *([AMOUNTS] * 5), identified=st.text(max_size=20)),
    PLACEMENTS,
)


def writable(text: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


@given(PROFILES.filter(lambda each: writable(repr(each) + each.device.model + each.device.serial)))
def test_profile_round_trips_exactly(known: Profile) -> None:
    from netboard.base.settings import write

    assert profile.parse(write(known), "test") == known


@given(st.lists(SERIALS.filter(writable), min_size=2, max_size=5, unique=True))
def test_each_serial_number_has_its_own_file_in_the_folder(serials: list[str]) -> None:
    folder = Path("profiles")
    files = {profile.file_of(folder, serial) for serial in serials}
    assert len(files) == len(serials)
    for file in files:
        assert file.parent == folder
        assert file.suffix == ".toml"
        assert all(letter.isascii() and (letter.isalnum() or letter in "_.-~%") for letter in file.name)


def make_profile(serial: str = "virtual-left", **placement: float) -> Profile:
    return Profile(Identity("virtual Touch", serial), placement=Placement(**placement))


def test_an_identified_mass_is_more_than_nothing() -> None:
    text = '[device]\nserial = "x"\n[mechanics]\nmass = 0.0\nidentified = "today"\n'
    with pytest.raises(ConfigError, match=r"\[mechanics\] mass: found 0, expected a number > 0"):
        profile.parse(text, "x.toml")


def test_mass_in_the_frame_of_the_scene_is_smaller_where_movements_are_larger(tmp_path: Path) -> None:
    """With the same force, a stylus whose movements are doubled is accelerated twice as much."""
    mechanics = Mechanics(mass=0.06, damping=0.2, identified="today")
    for known, expected in ((mechanics, (0.03, 0.1)), (Mechanics(), (0.0225, 0.05))):  # not identified: of [virtual]
        profile.save(tmp_path, replace(make_profile(scale=2.0), mechanics=known))
        with VirtualTouch("left", rig(tmp_path)) as device:
            assert (device.info.mass, device.info.damping) == expected


def test_load_returns_none_without_a_profile(tmp_path: Path) -> None:
    assert profile.load(tmp_path, "virtual-left") is None
    assert profile.load(tmp_path / "nowhere", "virtual-left") is None


def test_save_keeps_the_previous_profile_as_a_backup(tmp_path: Path) -> None:
    """Identification and calibration each write a profile: the first one must not be lost."""
    first, second, third = (make_profile(zero_z=z) for z in (0.01, 0.02, 0.03))
    path = profile.save(tmp_path / "profiles", first)
    assert profile.save(tmp_path / "profiles", second) == path
    assert profile.save(tmp_path / "profiles", third) == path
    assert profile.load(tmp_path / "profiles", "virtual-left") == third
    kept = {each.name: profile.parse(each.read_text("utf-8"), "bak") for each in path.parent.iterdir()}
    assert kept == {path.name: third, f"{path.name}.bak": first, f"{path.name}.bak.2": second}


def test_save_with_replace_keeps_no_backup(tmp_path: Path) -> None:
    for z in (0.01, 0.02):
        path = profile.save(tmp_path, make_profile(zero_z=z), replace=True)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_profile_of_another_device_is_rejected(tmp_path: Path) -> None:
    profile.save(tmp_path, make_profile("one")).rename(profile.file_of(tmp_path, "two"))
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
def test_invalid_profile_is_never_written(tmp_path: Path, wrong: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        profile.save(tmp_path, make_profile(**wrong))
    assert list(tmp_path.iterdir()) == []


def test_unusable_profile_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "profiles").write_text("a file")
    with pytest.raises(ConfigError, match="cannot be written"):
        profile.save(tmp_path / "profiles", make_profile())
    with pytest.raises(ConfigError, match="cannot be read"):
        profile.load(tmp_path / "profiles", "virtual-left")


# --- a device with a profile ---------------------------------------------------------------------------------------


def rig(folder: Path, zero: float = 0.0) -> Config:
    plain = Config()
    left = replace(plain.agents.left, zero=zero, options={"held": False})
    return replace(plain, agents=replace(plain.agents, left=left, profiles=str(folder)))


class Scripted(Device):
    """A device with a scripted reading."""

    reading = Reading(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, True)

    def _open(self) -> DeviceInfo:
        return DeviceInfo("Scripted", "scripted", 0.0, 0.0, 0.0, Box(-0.1, -0.1, -0.1, 0.1, 0.1, 0.1))

    def _read(self, now_ns: int) -> Reading:
        return self.reading._replace(stamp_ns=now_ns)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self.last = (fx, fy, fz)

    def _close(self) -> None:
        self.closed = True


OFFSETS = st.floats(-0.2, 0.2)


@given(PLACEMENTS.filter(lambda p: writable(p.calibrated)), st.tuples(*[OFFSETS] * 6), st.floats(-0.05, 0.05))
def test_profile_transforms_readings_to_the_scene_frame(
    tmp_path_factory: pytest.TempPathFactory, place: Placement, numbers: tuple[float, ...], agent_zero: float
) -> None:
    folder = tmp_path_factory.mktemp("profiles")
    profile.save(folder, Profile(Identity("Scripted", "scripted"), placement=place))
    device = Scripted("left", rig(folder, agent_zero))
    device.reading = Reading(0, *numbers, 3, True)
    with device:
        result = device.read(7)
        x, y, z, vx, vy, vz = numbers
        s = place.scale
        assert result[1:4] == pytest.approx(
            ((x - place.zero_x) * s, (y - place.zero_y) * s, (z - place.zero_z) * s - agent_zero), abs=1e-12
        )
        assert result[4:7] == pytest.approx((vx * s, vy * s, vz * s), abs=1e-12)
        assert result.ready == (Box(*place.box).holds(x, y, z) and max(abs(x), abs(y), abs(z)) <= 0.1)
        assert (result.stamp_ns, result.buttons) == (7, 3)
        assert device.info.details["profile_scale"] == repr(s)
    for restricted in (True, False):
        device.open(placed=False, restricted=restricted)
        own = device.read(8)
        assert own[1:7] == numbers
        assert own.ready == (max(abs(x), abs(y), abs(z)) <= 0.1 and (not restricted or result.ready))
        device.close()


def test_device_details_list_the_applied_profile(tmp_path: Path) -> None:
    known = Mechanics(0.045, 0.001, 0.1, 0.02, 0.26, 0.01, "then")
    profile.save(tmp_path, replace(make_profile(zero_z=0.02, scale=1.5), mechanics=known))
    with VirtualTouch("left", rig(tmp_path)) as device:
        details = device.info.details
        assert device.profile is not None
    assert details["profile_zero"] == "0.0 0.0 0.02 m"
    assert details["profile_mass"] == "0.045 +- 0.001 kg"
    assert details["profile_identified"] == "then"


def test_invalid_profile_leaves_the_device_closed(tmp_path: Path) -> None:
    profile.file_of(tmp_path, "scripted").write_text("[placement]\nscale = 0\n")
    device = Scripted("left", rig(tmp_path))
    with pytest.raises(ConfigError, match=r"scripted\.toml: \[placement\] scale"):
        device.open()
    assert device.closed
    with pytest.raises(ValueError, match="closed"):
        device.read(0)


def test_box_within_another_is_their_intersection() -> None:
    one, other = Box(-1, -2, -3, 1, 2, 3), Box(-2, -1, -1, 2, 1, 4)
    assert one.within(other) == Box(-1, -1, -1, 1, 1, 3)
    assert one.within(None) == one
