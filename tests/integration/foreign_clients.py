"""The JavaScript clients: location and requirements."""

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = Path(__file__).parent / "foreign"


def run(command: list[str], folder: Path) -> str:
    """What a command says that succeeds."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=180, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def fetched() -> Path:
    """Folder with the clients and the packages they need; these are fetched when the lock file has changed."""
    folder = ROOT / "build" / "foreign"
    lock, mark = SOURCE / "package-lock.json", folder / "fetched.json"
    shutil.copytree(SOURCE, folder, dirs_exist_ok=True)
    if not mark.exists() or mark.read_bytes() != lock.read_bytes():
        run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], folder)
        shutil.copy(lock, mark)
    return folder
