"""Read a text file that a user names, such as a configuration, up to a largest size."""

import errno
from pathlib import Path

LONGEST = 4_000_000
"""Largest length of a text [characters]; thousands of recordings fit the manifest of an import."""


def read_text(path: Path, encoding: str = "utf-8") -> str:
    """Return a text; raise OSError for one that is too long or has no end, as ``/dev/zero`` has none."""
    with path.open(encoding=encoding) as file:
        text = file.read(LONGEST + 1)
    if len(text) > LONGEST:
        raise OSError(errno.EFBIG, f"File too large, expected at most {LONGEST} characters", str(path))
    return text
