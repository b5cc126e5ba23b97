"""What has been measured of one device: its mechanics, and how its own frame becomes the scene's.

A profile belongs to a serial number, not to a side: it stays true when the two devices of a rig change places. It is a
TOML file in the folder ``agents.profiles``, named after the serial number, written by ``netboard devices identify`` and
``netboard devices calibrate`` and read whenever the device is opened. A device without a profile is taken as it is.

A file is never half written: the new text goes to another name first, and the file before it is kept as ``.bak``.
"""

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

from pydantic import TypeAdapter

from netboard.base.errors import ConfigError
from netboard.base.settings import NO_EXTRAS, about, read, write

REACH = 1.0
"""No device's workspace reaches further from its origin [m]."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Whose profile it is."""

    __pydantic_config__ = NO_EXTRAS
    model: Annotated[str, about("maker's name of the device")] = ""
    serial: Annotated[str, about("serial number of the device")] = ""


@dataclass(frozen=True, slots=True)
class Mechanics:
    """What the hand feels of the device when its motors rest, with half the width of the 95 % confidence intervals."""

    __pydantic_config__ = NO_EXTRAS
    mass: Annotated[float, about("apparent mass at the stylus", "kg", ge=0)] = 0.0
    mass_half_width: Annotated[float, about("half width of its confidence interval", "kg", ge=0)] = 0.0
    damping: Annotated[float, about("viscous damping", "N s/m", ge=0)] = 0.0
    damping_half_width: Annotated[float, about("half width of its confidence interval", "N s/m", ge=0)] = 0.0
    friction: Annotated[float, about("Coulomb friction", "N", ge=0)] = 0.0
    friction_half_width: Annotated[float, about("half width of its confidence interval", "N", ge=0)] = 0.0
    identified: Annotated[str, about("when and how that was found; empty: never")] = ""


@dataclass(frozen=True, slots=True)
class Placement:
    """How the device's own frame becomes the scene's: scene = (device - zero) * scale, inside the box."""

    __pydantic_config__ = NO_EXTRAS
    zero_x: Annotated[float, about("the scene's origin, out of the screen", "m", ge=-REACH, le=REACH)] = 0.0
    zero_y: Annotated[float, about("the scene's origin, to the right", "m", ge=-REACH, le=REACH)] = 0.0
    zero_z: Annotated[float, about("the scene's origin, upwards", "m", ge=-REACH, le=REACH)] = 0.0
    scale: Annotated[float, about("length in the scene of one metre at the device", "1", ge=0.1, le=10)] = 1.0
    x_min: Annotated[float, about("workspace, far end: into the screen", "m", ge=-REACH, le=REACH)] = -REACH
    y_min: Annotated[float, about("workspace, left end", "m", ge=-REACH, le=REACH)] = -REACH
    z_min: Annotated[float, about("workspace, lower end", "m", ge=-REACH, le=REACH)] = -REACH
    x_max: Annotated[float, about("workspace, near end: out of the screen", "m", ge=-REACH, le=REACH)] = REACH
    y_max: Annotated[float, about("workspace, right end", "m", ge=-REACH, le=REACH)] = REACH
    z_max: Annotated[float, about("workspace, upper end", "m", ge=-REACH, le=REACH)] = REACH
    calibrated: Annotated[str, about("when and how that was set; empty: never")] = ""

    @property
    def box(self) -> tuple[float, float, float, float, float, float]:
        """The workspace: least x, y, z, then the largest ones [m]."""
        return self.x_min, self.y_min, self.z_min, self.x_max, self.y_max, self.z_max


@dataclass(frozen=True, slots=True)
class Profile:
    """What is known of one device, all positions in its own frame: x out of the screen, y right, z up."""

    __pydantic_config__ = NO_EXTRAS
    device: Identity = field(default_factory=Identity)
    mechanics: Mechanics = field(default_factory=Mechanics)
    placement: Placement = field(default_factory=Placement)


ADAPTER: TypeAdapter[Profile] = TypeAdapter(Profile)


def file_of(folder: Path, serial: str) -> Path:
    """File of a device's profile: another one for every serial number, whatever its characters."""
    return folder / f"{quote(serial, safe='')}.toml"


def parse(text: str, source: str) -> Profile:
    """Read a profile.

    Parameters
    ----------
    text : str
        TOML text.
    source : str
        Name of the file, for error messages.

    Raises
    ------
    ConfigError
        If a key is unknown or wrong, an end of the workspace is beyond its other end, or the zero is not within it.
    """
    profile = read(ADAPTER, Profile, text, source)
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
    """Read the profile of a device.

    Parameters
    ----------
    folder : Path
        Where profiles are.
    serial : str
        The device's serial number.

    Returns
    -------
    Profile or None
        None if it has none.

    Raises
    ------
    ConfigError
        If the file cannot be read, is wrong, or belongs to another device.
    """
    path = file_of(folder, serial)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: the device's profile cannot be read: {error}") from error
    profile = parse(text, str(path))
    if profile.device.serial != serial:
        raise ConfigError(
            f'{path}: [device] serial: found "{profile.device.serial}", expected "{serial}", the device that is here'
        )
    return profile


def save(folder: Path, profile: Profile, *, replace: bool = False) -> Path:
    """Write the profile of a device.

    Parameters
    ----------
    folder : Path
        Where profiles are; made if it is not there.
    profile : Profile
        What to write.
    replace : bool
        Keep nothing of the profile before; otherwise it is kept beside the new one, as ``.bak``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ConfigError
        If what is to be written is no valid profile, or cannot be written.
    """
    path = file_of(folder, profile.device.serial)
    text = write(profile)
    parse(text, str(path))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        fresh = path.with_name(f"{path.name}.new")
        with fresh.open("w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if path.exists() and not replace:
            shutil.copy2(path, path.with_name(f"{path.name}.bak"))
        fresh.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: the device's profile cannot be written: {error}") from error
    return path


def in_words(profile: Profile) -> Mapping[str, str]:
    """Say what of a profile is in force, with units, for the record.

    Parameters
    ----------
    profile : Profile
        The profile of an open device.
    """
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
