"""The JavaScript clients: location and requirements."""

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = Path(__file__).parent / "foreign"


def run(command: list[str], folder: Path) -> str:
    """Run a command that must succeed, and return its output."""
    completed = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=180, check=False)
    assert completed.returncode == 0, completed.stderr
    return completed.stdout


def install_clients() -> Path:
    """Folder with the clients and their packages, which are installed when the lock file has changed."""
    folder = ROOT / "build" / "foreign"
    lock, mark = SOURCE / "package-lock.json", folder / "fetched.json"
    shutil.copytree(SOURCE, folder, dirs_exist_ok=True)
    if not mark.exists() or mark.read_bytes() != lock.read_bytes():
        run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], folder)
        shutil.copy(lock, mark)
    return folder
