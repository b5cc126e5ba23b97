"""The folder of a laboratory, with each file that the pages of docs name: recordings, tables, studies, configurations.

A file is made when a page first needs it, once, and copied into the folder of each block. Names of recordings on the
pages, which have the digits of a session, are those of the two blocks here: `local` changes them.
"""

import csv
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

import code_blocks

RECORDING = re.compile(r"recordings/S\d\d_\S*?\.mcap(?!\.)")
NWB = re.compile(r"sub-P22/sub-P22_ses-D07S02_run-01_behavior\.nwb")


class LabFolder:
    """Makes and keeps the files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def prepare(self, text: str, target: Path) -> None:
        """Copy into a folder the files that a text names."""
        for name, make in MAKERS.items():
            end = "" if name.endswith("/") else r"(?!\w)"
            named = re.search(rf"(?<![\w/]){re.escape(name)}{end}", text)
            if named and not (target / name).exists():
                self.require(name, make)
                self._copy(name, target)

    def require(self, name: str, make: Callable[["LabFolder"], None] | None = None) -> Path:
        """Return a file or folder; make it if it does not exist."""
        path = self._folder / name
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            (make or MAKERS[name])(self)
        return path

    def path(self, name: str) -> Path:
        """Return the place of a file."""
        return self._folder / name

    def run(self, command: str) -> None:
        """Run a command in the folder; it must succeed."""
        done = code_blocks.run(command, self._folder)
        assert done.returncode == 0, f"{command}:\n{done.stdout}{done.stderr}"

    def _copy(self, name: str, target: Path) -> None:
        source = self._folder / name
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target / name, dirs_exist_ok=True)
        else:
            shutil.copy(source, target / name)


def local(text: str) -> str:
    """Replace names of recordings and NWB files on the pages by those of the files here."""
    return NWB.sub("one.nwb", RECORDING.sub("S01.mcap", text))


def _recordings(lab: LabFolder) -> None:
    lab.run("netboard session rehearse pilot --dyad 3 --blocks 2 --trials 3 --output recordings")


def _recording(number: int) -> Callable[[LabFolder], None]:
    def make(lab: LabFolder) -> None:
        (source,) = lab.require("recordings").glob(f"*_block0{number}_*.mcap")
        shutil.copy(source, lab.path(f"S0{number}.mcap"))

    return make


def _unfinished(lab: LabFolder) -> None:
    whole = lab.require("S01.mcap").read_bytes()
    lab.path("recordings/NAME.mcap.part").write_bytes(whole[: len(whole) * 3 // 4])


def _rig(lab: LabFolder) -> None:
    """Write a configuration whose left device, a simulated one, lies on the table."""
    lab.run("netboard config init rig.toml")
    text = lab.path("rig.toml").read_text(encoding="utf-8")
    head = "[agents.left.options]"
    assert head in text
    lab.path("rig.toml").write_text(text.replace(head, f"{head}\nheld = false"), encoding="utf-8")


def _exported_study(lab: LabFolder) -> None:
    lab.require("S01.mcap")
    lab.run("netboard export S01.mcap --to parquet -o study")


def _exported_xdf(lab: LabFolder) -> None:
    lab.require("S01.mcap")
    lab.run("netboard export S01.mcap --to xdf -o xdf && cp xdf/*.xdf S01.xdf")


def _exported_nwb(lab: LabFolder) -> None:
    lab.require("S01.mcap")
    lab.run("netboard export S01.mcap --to nwb -o nwb && cp $(ls nwb/*/*.nwb | head -n 1) one.nwb")


def _hands(lab: LabFolder, name: str, columns: dict[str, float], rate: float = 100.0) -> None:
    """Write the heights of two hands that move up and down for 2 s; `columns` have their scales, `rate` is in Hz."""
    t = np.arange(2.0 * rate) / rate
    z, v = 0.005 * (1 - np.cos(2 * t)), 0.01 * np.sin(2 * t)
    sources = {"t": t, "time": t, "p": 0 * t, "Ball": 0 * t}
    lab.path(name).parent.mkdir(parents=True, exist_ok=True)
    with lab.path(name).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        data = [factor * sources.get(column, v if "v" in column else z) for column, factor in columns.items()]
        writer.writerows(zip(*data, strict=True))


def _stylus(name: str) -> Callable[[LabFolder], None]:
    return lambda lab: _hands(lab, name, dict.fromkeys(("t", "z_left", "v_left", "z_right", "v_right"), 1.0))


def _theirs(name: str, rate: float = 100.0) -> Callable[[LabFolder], None]:
    scale = 1.0 if name == "hands.csv" else 1e3
    heights = ("time", "left_z", "right_z") if name == "hands.csv" else ("t", "Height1", "Height2", "Ball")
    return lambda lab: _hands(lab, name, dict.fromkeys(heights, scale), rate)


def _wrong_manifest(lab: LabFolder) -> None:
    """Write the manifest of the page with a block listed twice and a table that does not exist."""
    (block,) = (block for block in code_blocks.blocks() if block.value == "manifest.toml")
    text = block.text.replace("number = 2", "number = 1").replace('config = "rig.toml"', "#")
    lab.path("wrong.toml").write_text(f'{text}\n[[recording]]\nfile = "D02/block1.csv"\n', encoding="utf-8")


MAKERS: dict[str, Callable[[LabFolder], None]] = {
    "recordings": _recordings,
    "S01.mcap": _recording(1),
    "S02.mcap": _recording(2),
    "recordings/NAME.mcap.part": _unfinished,
    "rig.toml": _rig,
    "study.toml": lambda lab: lab.run("netboard plan template > study.toml"),
    "study/": _exported_study,
    "S01.xdf": _exported_xdf,
    "one.nwb": _exported_nwb,
    "stylus.csv": _stylus("stylus.csv"),
    "hands/": _stylus("hands/one.csv"),
    "theirs.csv": _theirs("theirs.csv"),
    "hands.csv": _theirs("hands.csv"),
    "D01/block1.csv": _theirs("D01/block1.csv"),
    "D01/block2.csv": _theirs("D01/block2.csv", 200.0),
    "wrong.toml": _wrong_manifest,
}
"""Files by their names on the pages."""
