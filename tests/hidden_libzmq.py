"""Processes whose pyzmq does not show libzmq's functions, as its wheels for Windows: frames pass through Python.

Python imports ``sitecustomize`` as it starts, so the processes that such a process starts hide them, too.
"""

import os
from importlib.util import find_spec
from pathlib import Path

PROOF = "frames pass through Python"
"""What each process that uses kernels' sockets says as it ends."""

OTHER_LIBRARY = find_spec("msgpack._cmsgpack")
assert OTHER_LIBRARY is not None

HIDING = f"""
import atexit, sys, zmq
# A library without libzmq's functions, as pyzmq's binding in a wheel for Windows.
sys.modules[zmq.backend.Socket.__module__].__file__ = {OTHER_LIBRARY.origin!r}

@atexit.register
def say():
    seam = sys.modules.get("netboard.network.transport.libzmq")
    if seam is not None and seam._THROUGH_PYTHON is not None:
        print({PROOF!r}, file=sys.stderr)
"""


def hiding_environment(folder: Path, *others: Path) -> dict[str, str]:
    """Return variables of the environment with which a process hides libzmq; ``others``: folders of more modules."""
    place = folder / "hiding"
    place.mkdir()
    (place / "sitecustomize.py").write_text(HIDING, encoding="utf-8")
    return {"PYTHONPATH": os.pathsep.join(map(str, (place, *others)))}
