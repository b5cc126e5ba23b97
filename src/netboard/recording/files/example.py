"""The recording that netboard ships: one trial of two simulated participants with haptic feedback, 10 s long.

It is there to try tools and to develop readers, and shows nothing about people.
"""

import shutil
from importlib.resources import as_file, files
from pathlib import Path

from netboard.base.files.new import new_file

NAME = "example.mcap"


def copy_example(path: Path) -> None:
    """Copy the recording to a new file."""
    with as_file(files("netboard.recording.files").joinpath(NAME)) as source, new_file(path) as part:
        shutil.copyfile(source, part)
