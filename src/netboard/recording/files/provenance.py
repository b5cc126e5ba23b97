"""Provenance of a recording: its file name and its metadata on session, software and computer.

All values are text, as MCAP metadata require. Participants appear only under the dyad's pseudonym. The computer appears
under its platform, without its host name.
"""

import hashlib
import os
import platform
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path

import mcap

from netboard.base.config import Config
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.process.resources import home_folder
from netboard.base.settings import parse_json
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.recording.format.channels import FORMAT_VERSION
from netboard.recording.format.claims import MAX_STAMP_NS, whole_number

CONFIG_NAME = "netboard.toml"
"""Name of the attachment that holds the resolved configuration."""


class MetadataName(StrEnum):
    """Names of the metadata records."""

    OPENED = "netboard"  # written when the file is opened
    FIRST = "netboard.first"  # before the first record from the server
    END = "netboard.end"  # when the file is finished
    RECOVERY = "netboard.recovery"  # of a recovered file


_NUMBERS: dict[str, tuple[str, ...]] = {
    MetadataName.OPENED: ("opened_log_ns", "opened_monotonic_ns", "welcome_server_ns", "block", "blocks"),
    MetadataName.FIRST: ("record",),
    MetadataName.END: ("log_ns", "records", "lost", "next_record"),
}
"""Metadata that are read as whole numbers. MCAP stores no checksum of a metadata record."""

SEQUENCE = "sequence"
"""Key of the recovery metadata which says that sequence and identity of all data were examined; older files lack it."""

LIBRARY = f"netboard {version('netboard')} (mcap {mcap.__version__})"
"""Library name in the header of recordings."""

_PACKAGES = ("numpy", "numba", "llvmlite", "pyzmq", "msgpack", "mcap", "zstandard")


def config_sha256(text: bytes) -> str:
    """Return the SHA-256 hash of a resolved configuration, in hexadecimal."""
    return hashlib.sha256(text).hexdigest()


def damaged_numbers(name: str, values: Mapping[str, str]) -> list[str]:
    """Return the keys in a metadata record whose value should be a whole number and is not."""
    found = {key: whole_number(values.get(key, "0")) for key in _NUMBERS.get(name, ())}
    return [key for key, number in found.items() if number is None or number < 0]


def has_every_number(metadata: Mapping[str, Mapping[str, str]]) -> bool:
    """Return whether the metadata records of a finished recording have all values that are whole numbers."""
    return all(key in metadata.get(name, {}) for name, keys in _NUMBERS.items() for key in keys)


def provenance(welcome: Welcome, config: Config, part: int, utc_ns: int, monotonic_ns: int) -> dict[str, str]:
    """Return the metadata of a new recording.

    ``utc_ns``: wall-clock time at which the file is opened; log time starts there [ns].
    """
    return {
        "format": FORMAT_VERSION,
        "session": welcome.session,
        "part": str(part),
        "name": config.session.name,
        "dyad": config.session.dyad,
        "pilot": str(config.session.pilot).lower(),
        "study": config.session.study,
        "block": str(config.block.number),
        "blocks": str(config.block.blocks),
        "config_sha256": config_sha256(welcome.config.encode()),
        "opened_utc": utc_of(utc_ns).isoformat(),
        "opened_log_ns": str(utc_ns),
        "opened_monotonic_ns": str(monotonic_ns),
        "welcome_server_ns": str(welcome.server_ns),
        "protocol": str(PROTOCOL_VERSION),
        "netboard": version("netboard"),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "platform": platform.platform(),
        **{package: version(package) for package in _PACKAGES},
        **_doctor_report(utc_ns),
    }


def utc_of(utc_ns: int) -> datetime:
    """Return the second of a wall-clock time; refuse one that no recording can have [ns]."""
    if not 0 <= utc_ns <= MAX_STAMP_NS:
        raise RecordingError(
            f"the time is {utc_ns / 1e9:.6g} s after 1970, expected a time from 1970 to 2262; set the clock of this "
            "computer"
        )
    return datetime.fromtimestamp(utc_ns // 1_000_000_000, UTC)


def doctor_report_path() -> Path:
    """Return the path where `netboard doctor` stores its latest report, one per user and computer."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else home_folder() / ".local" / "state") / "netboard" / "doctor.json"


def _doctor_report(utc_ns: int) -> dict[str, str]:
    """Return the latest doctor report on this computer, as a one-line summary and in full."""
    try:
        text = doctor_report_path().read_text(encoding="utf-8")
        report = parse_json(text)
        age = utc_of(utc_ns) - datetime.fromisoformat(report["utc"])
        return {"doctor": f"{report['summary']}; {age.total_seconds() / 3600:.1f} h before", "doctor_report": text}
    except (FileNotFoundError, ConfigError):
        return {"doctor": "not asked", "doctor_report": ""}
    except (OSError, ValueError, KeyError, TypeError) as error:
        return {"doctor": f"its report cannot be read: {type(error).__name__}", "doctor_report": ""}


def _short(session: str) -> str:
    """Return the first eight letters and digits of a session id, which are safe in any file name."""
    return re.sub(r"[^A-Za-z0-9]", "", session)[:8] or "unnamed"


def next_recording(directory: Path, config: Config, session: str, utc_ns: int) -> tuple[Path, int]:
    """Return the path and part number of the next file of a session."""
    stem, short = f"{config.session.name}_{config.session.dyad}", _short(session)
    block = f"_block{config.block.number:02d}" if config.block.blocks > 1 else ""
    pattern = re.compile(
        rf"{re.escape(stem)}_\d{{8}}T\d{{6}}Z_{short}{block}(?:_part(\d+))?(?:\.recovered)?\.mcap(?:\.part)?"
    )
    found = (pattern.fullmatch(file.name) for file in directory.iterdir())
    part = 1 + max((int(match[1] or 1) for match in found if match), default=0)
    stamp = utc_of(utc_ns).strftime("%Y%m%dT%H%M%SZ")
    suffix = f"_part{part}" if part > 1 else ""
    return directory / f"{stem}_{stamp}_{short}{block}{suffix}.mcap", part


def recovered_name(metadata: Mapping[str, str]) -> str:
    """Return the file name of a recovered recording from its own metadata; empty if they lack what it needs."""
    if not {"name", "dyad", "session", "opened_utc"} <= metadata.keys():
        return ""
    stamp = re.sub(r"[^0-9T]", "", metadata["opened_utc"].partition("+")[0])
    stem = re.sub(r"[^\w.-]", "", f"{metadata['name']}_{metadata['dyad']}")
    block, part = metadata.get("block", ""), metadata.get("part", "1")
    numbered = f"_block{int(block):02d}" * (block.isdecimal() and metadata.get("blocks", "1") != "1")
    later = f"_part{part}" * (part.isdecimal() and part != "1")
    return f"{stem}_{stamp}Z_{_short(metadata['session'])}{numbered}{later}.recovered.mcap"
