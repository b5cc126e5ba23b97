"""Libraries in C of a servo, compiled on first use with the system's compiler and cached beside the compiled kernels.

The cached file is named by its source, ``rings.h`` and the computer, so a new source is compiled again; and it is
sealed, so a damaged file is, too. On Windows nothing is compiled, whatever compiler is there.
"""

import hashlib
import logging
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

from netboard.base.errors import NetboardError
from netboard.base.files.sealed import Damaged, unsealed, write_sealed
from netboard.base.system import c_library

log = logging.getLogger(__name__)

RINGS = Path(__file__).with_name("rings.h")

COMPILERS = ("cc", "gcc", "clang")
"""Compilers in the order of preference, unless the environment variable CC names one."""

FLAGS = ("-O2", "-std=gnu11", "-shared", "-fPIC", f"-I{RINGS.parent}")

INSTALL_HINT = "install a C compiler (Debian, Ubuntu: gcc and libc6-dev)"

USE_POSIX = "connect the device to a computer with Linux"


class CannotCompile(NetboardError):
    """A library in C cannot be compiled here; the message continues its name. ``advice``: what helps."""

    def __init__(self, words: str, advice: str = INSTALL_HINT) -> None:
        super().__init__(words)
        self.advice = advice


def compiled_library(folder: Path, source: Path, *options: str) -> Path:
    """Compile a library in C into a folder, unless it is there already; raise `CannotCompile`."""
    if not c_library.HAS_POSIX:
        raise CannotCompile("is not for Windows: it uses the clock and the threads of POSIX", USE_POSIX)
    command, name = [*_compiler(), *FLAGS, *options], source.stem
    texts = source.read_bytes() + RINGS.read_bytes()
    state = hashlib.sha256(texts + " ".join((*command, platform.machine())).encode())
    kept = folder / f"{name}-{state.hexdigest()[:16]}.so"
    if _is_sound(kept):
        return kept
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            fresh = Path(scratch) / kept.name
            _compile(command, source, fresh)
            write_sealed(kept, fresh.read_bytes())
    except OSError as error:
        raise CannotCompile(f"cannot be kept in {folder}: {error}") from error
    return kept


def _is_sound(kept: Path) -> bool:
    """Tell whether the library is there as it was compiled; the linker would load, or crash on, a damaged one."""
    try:
        unsealed(kept.read_bytes())
    except FileNotFoundError:
        return False
    except (Damaged, OSError) as error:
        log.warning("%s: %s; it is compiled again", kept, error)
        return False
    return True


def _compile(command: list[str], source: Path, library: Path) -> None:
    """Run the compiler."""
    command = [*command, "-o", str(library), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode or not library.is_file():
        why = (done.stderr.strip().splitlines() or ["it does not say why"])[0]
        raise CannotCompile(f"cannot be compiled by {command[0]}: {why}")


def _compiler() -> list[str]:
    """Return the command of the system's compiler."""
    named = shlex.split(os.environ.get("CC", ""))
    for command in [named] if named else [[name] for name in COMPILERS]:
        if shutil.which(command[0]):
            return command
    tried = " ".join(named) or ", ".join(COMPILERS)
    raise CannotCompile(f"needs a compiler, and there is none ({tried})")
