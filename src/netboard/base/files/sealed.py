"""Cache files whose content is verified before use: the content, then its SHA-256.

The digest is at the end, because the linker of the operating system ignores what follows a shared library, so that
a library can be sealed, too. A file gets its name when it is on disk as a whole. A power cut or a failing disk can
nevertheless leave an empty, shortened or zeroed file, which `unsealed` tells from a sound one.
"""

import hashlib
import os
import uuid
from contextlib import suppress
from pathlib import Path

DIGEST_BYTES = hashlib.sha256().digest_size


class Damaged(Exception):
    """A file of a cache does not have the content that was written; the message says how it differs."""


def sealed(content: bytes) -> bytes:
    """Return a content with its digest."""
    return content + hashlib.sha256(content).digest()


def unsealed(whole: bytes) -> memoryview:
    """Return the content of a sealed file; raise `Damaged` if it is not what was sealed."""
    if not whole:
        raise Damaged("is empty")
    content, digest = memoryview(whole)[:-DIGEST_BYTES], whole[-DIGEST_BYTES:]
    if hashlib.sha256(content).digest() != digest:
        raise Damaged("has only zeroes" if not any(whole) else "is incomplete or was changed")
    return content


def write_sealed(path: Path, content: bytes) -> None:
    """Write a sealed file to disk under a temporary name, and rename it; no error leaves a part."""
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        with part.open("wb") as file:
            file.write(sealed(content))
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise
