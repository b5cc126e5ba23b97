"""A file that is complete or absent: written under a temporary name, and then renamed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from netboard.base.errors import NetboardError, writing


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yield the temporary path; at the end the file gets its name, in place of an existing one. No error leaves a part.

    A caller that keeps existing files refuses them as the last step.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with writing(path, NetboardError):
        try:
            yield part
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
