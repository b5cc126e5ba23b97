"""The profiles of all devices in a folder."""

from pathlib import Path
from urllib.parse import unquote

from netboard.base.errors import ConfigError
from netboard.devices.contract import profile


def require_profiles(folder: Path) -> None:
    """Refuse a folder with an invalid profile, or with one of another device than its name says.

    Raises `ConfigError` with every problem. A missing folder has no profiles.
    """
    problems = []
    for path in sorted(folder.glob("*.toml")):
        try:
            profile.load(folder, unquote(path.stem))
        except ConfigError as error:
            problems.append(str(error))
    if problems:
        raise ConfigError("\n".join(problems))
