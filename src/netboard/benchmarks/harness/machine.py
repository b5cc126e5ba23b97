"""Description of the machine that a study ran on, for the head of its results."""

import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from llvmlite.binding import get_host_cpu_features

from netboard.base.process.workers import cores
from netboard.base.system.c_library import load_average

LIBRARIES = ("netboard", "numba", "llvmlite", "numpy", "scipy")
"""Libraries whose version can change a result."""


@dataclass(frozen=True)
class Machine:
    """A machine and the software that a study ran with.

    - `load`: load average of the last minute; NaN if the system does not report it [1].
    """

    system: str
    cpu: str
    cores: int
    vectors: str
    load: float
    python: str
    libraries: dict[str, str]

    def lines(self) -> list[str]:
        """Return the description as lines of text."""
        return [
            f"{self.cpu}, {self.cores} cores, {self.vectors}, load {self.load:.2f}",
            f"{self.system}, Python {self.python}",
            ", ".join(f"{name} {number}" for name, number in self.libraries.items()),
        ]


def describe() -> Machine:
    """Return the description of this machine now."""
    return Machine(
        system=platform.platform(),
        cpu=_cpu(),
        cores=cores(),
        vectors=_vectors(),
        load=load_average(),
        python=platform.python_version(),
        libraries={name: version_of(name) for name in LIBRARIES},
    )


def version_of(library: str) -> str:
    """Return the version of a library that may not be installed as a package."""
    try:
        return version(library)
    except PackageNotFoundError:
        return "not installed"


def _cpu() -> str:
    """Return the model of the processor, with family and model numbers, since a virtual machine may hide the name."""
    listing = Path("/proc/cpuinfo")
    if not listing.exists():
        return platform.processor() or platform.machine()
    entries: dict[str, str] = {}
    for line in listing.read_text(encoding="utf-8").splitlines():
        name, _, value = line.partition(":")
        entries.setdefault(name.strip(), value.strip())
    if "model name" not in entries:
        return platform.machine()
    return f"{entries['model name']} (family {entries.get('cpu family', '?')}, model {entries.get('model', '?')})"


def _vectors() -> str:
    """Return the widest vector instructions of the processor."""
    has = get_host_cpu_features()
    for name in ("avx512f", "avx2", "avx", "sse2", "sve", "neon"):
        if has.get(name):
            return name
    return "no vector instructions"
