"""Device profiles: measured mechanics of a device, and the transform from its own frame to the scene's.

A profile belongs to a serial number, not to a side, so it stays valid when two devices swap places. It is a TOML file
in the folder ``agents.profiles``, named after the serial number. ``netboard devices identify`` and ``netboard devices
calibrate`` write it, and it is read whenever the device is opened. A device without a profile is used unchanged.

Files are replaced atomically: the new text goes to a temporary name first. The previous file is kept as ``.bak``,
later ones as ``.bak.2`` and so on.
"""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

from pydantic import TypeAdapter

from netboard.base.errors import ConfigError
from netboard.base.files.new import free_backup, write_synced
from netboard.base.files.text import find_text
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about, read, write

REACH = 1.0
"""Upper bound for the distance of any workspace from the device's origin [m]."""

MAX_SCALE = 10.0
"""Upper bound of the scale [1]."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity of the profiled device."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    model: Annotated[str, about("maker's name of the device")] = ""
    serial: Annotated[str, about("serial number of the device")] = ""


@dataclass(frozen=True, slots=True)
class Mechanics:
    """Mechanics that the hand feels with the motors off, with half-widths of the 95 % confidence intervals."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    mass: Annotated[float, about("apparent mass at the stylus", "kg", ge=0)] = 0.0
    mass_half_width: Annotated[float, about("half width of its confidence interval", "kg", ge=0)] = 0.0
    damping: Annotated[float, about("viscous damping", "N s/m", ge=0)] = 0.0
    damping_half_width: Annotated[float, about("half width of its confidence interval", "N s/m", ge=0)] = 0.0
    friction: Annotated[float, about("Coulomb friction", "N", ge=0)] = 0.0
    friction_half_width: Annotated[float, about("half width of its confidence interval", "N", ge=0)] = 0.0
    identified: Annotated[str, about("when and how that was found; empty: never")] = ""


@dataclass(frozen=True, slots=True)
class Placement:
    """Transform from the device's own frame to the scene's: scene = (device - zero) * scale, inside the box."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    zero_x: Annotated[float, about("the scene's origin, out of the screen", "m", ge=-REACH, le=REACH)] = 0.0
    zero_y: Annotated[float, about("the scene's origin, to the right", "m", ge=-REACH, le=REACH)] = 0.0
    zero_z: Annotated[float, about("the scene's origin, upwards", "m", ge=-REACH, le=REACH)] = 0.0
    scale: Annotated[float, about("length in the scene of one metre at the device", "1", ge=0.1, le=MAX_SCALE)] = 1.0
    x_min: Annotated[float, about("workspace, far end: into the screen", "m", ge=-REACH, le=REACH)] = -REACH
    y_min: Annotated[float, about("workspace, left end", "m", ge=-REACH, le=REACH)] = -REACH
    z_min: Annotated[float, about("workspace, lower end", "m", ge=-REACH, le=REACH)] = -REACH
    x_max: Annotated[float, about("workspace, near end: out of the screen", "m", ge=-REACH, le=REACH)] = REACH
    y_max: Annotated[float, about("workspace, right end", "m", ge=-REACH, le=REACH)] = REACH
    z_max: Annotated[float, about("workspace, upper end", "m", ge=-REACH, le=REACH)] = REACH
    calibrated: Annotated[str, about("when and how that was set; empty: never")] = ""

    @property
    def box(self) -> tuple[float, float, float, float, float, float]:
        """Workspace: minimum x, y, z, then maximum x, y, z [m]."""
        return self.x_min, self.y_min, self.z_min, self.x_max, self.y_max, self.z_max


@dataclass(frozen=True, slots=True)
class Profile:
    """Profile of one device. All positions are in the device's frame: x out of the screen, y right, z up."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    device: Identity = field(default_factory=Identity)
    mechanics: Mechanics = field(default_factory=Mechanics)
    placement: Placement = field(default_factory=Placement)


ADAPTER: TypeAdapter[Profile] = TypeAdapter(Profile)


def file_of(folder: Path, serial: str) -> Path:
    """Return the path of a device's profile; serial numbers with any characters map to distinct files."""
    return folder / f"{quote(serial, safe='')}.toml"


def parse(text: str, source: str) -> Profile:
    """Parse a profile.

    ``source``: file name, for error messages. Raises `ConfigError` if a key is unknown or wrong, an identified mass is
    0, a lower bound of the workspace exceeds its upper bound, or the zero is outside.
    """
    profile = read(ADAPTER, Profile, text, source)
    if profile.mechanics.identified and profile.mechanics.mass <= 0.0:
        raise ConfigError(f"{source}: [mechanics] mass: found {profile.mechanics.mass:g}, expected a number > 0")
    for axis in ("x", "y", "z"):
        low, zero, high = (getattr(profile.placement, name) for name in (f"{axis}_min", f"zero_{axis}", f"{axis}_max"))
        if low >= high:
            raise ConfigError(
                f"{source}: [placement] {axis}_min: found {low:g}, expected less than {axis}_max, {high:g}"
            )
        if not low <= zero <= high:
            raise ConfigError(
                f"{source}: [placement] zero_{axis}: found {zero:g}, expected within the workspace, {low:g} to {high:g}"
            )
    return profile


def load(folder: Path, serial: str) -> Profile | None:
    """Load the profile of a device.

    Returns None if the device has no profile. Raises `ConfigError` if the file is unreadable or invalid, or belongs to
    another device.
    """
    path = file_of(folder, serial)
    text = find_text(path)
    if text is None:
        return None
    profile = parse(text, str(path))
    if profile.device.serial != serial:
        raise ConfigError(
            f'{path}: [device] serial: found "{profile.device.serial}", expected "{serial}", the device that is here'
        )
    return profile


def save(folder: Path, profile: Profile, *, replace: bool = False) -> Path:
    """Save the profile of a device.

    The folder is created if missing. ``replace``: without keeping the previous profile as a backup. Returns the path of
    the file. Raises `ConfigError` if the profile is invalid or the file cannot be written.
    """
    path = file_of(folder, profile.device.serial)
    text = write(profile)
    parse(text, str(path))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        fresh = path.with_name(f"{path.name}.new")
        write_synced(fresh, text)
        if path.exists() and not replace:
            shutil.copy2(path, free_backup(path))
        fresh.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: the device's profile cannot be written: {error}") from error
    return path


def in_words(profile: Profile) -> Mapping[str, str]:
    """Describe the values in force of a profile, with units, for the recording's metadata."""
    place, mechanics = profile.placement, profile.mechanics
    zero = (place.zero_x, place.zero_y, place.zero_z)
    words = {
        "profile_zero": f"{' '.join(map(repr, zero))} m",
        "profile_scale": repr(place.scale),
        "profile_workspace": f"{' '.join(map(repr, place.box))} m",
    }
    if place.calibrated:
        words["profile_calibrated"] = place.calibrated
    if mechanics.identified:
        words["profile_mass"] = f"{mechanics.mass!r} +- {mechanics.mass_half_width!r} kg"
        words["profile_damping"] = f"{mechanics.damping!r} +- {mechanics.damping_half_width!r} N s/m"
        words["profile_friction"] = f"{mechanics.friction!r} +- {mechanics.friction_half_width!r} N"
        words["profile_identified"] = mechanics.identified
    return words
