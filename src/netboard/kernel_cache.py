"""Where the compiled kernels are kept between runs, so that they are never older than their source.

Numba renews a kept kernel when its own file has changed, but not when a kernel it calls has changed in another file: it
would silently go on with the old code. So the cache has a folder for every state of the package's source, and the
folders of other states are removed.
"""

import hashlib
import os
import shutil
from pathlib import Path

PREFIX = "kernels-"


def choose_folder() -> None:
    """Tell numba, before it is imported, where to keep kernels; a folder the user has chosen stays."""
    package = Path(__file__).parent
    state = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        state.update(source.read_bytes())
    folder = package / "__pycache__" / f"{PREFIX}{state.hexdigest()[:16]}"
    if os.environ.setdefault("NUMBA_CACHE_DIR", str(folder)) == str(folder) and not folder.exists():
        for other in folder.parent.glob(f"{PREFIX}*"):
            shutil.rmtree(other, ignore_errors=True)
