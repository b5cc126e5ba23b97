"""Simulation of a scene from recorded hands: one file of hands in, one file of results out, and a summary of each."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType
from rich.text import Text

from netboard.base.config import ADAPTER, Config, contradictions_of_scene, resolve
from netboard.base.errors import ConfigError
from netboard.base.files.text import read_text
from netboard.base.settings import read
from netboard.base.tables.scene import Physics
from netboard.base.terminal.bars import telling
from netboard.base.terminal.output import FittedTable
from netboard.physics.hands.sampled import Hands
from netboard.physics.simulation import (
    TOLERANCE,
    Motion,
    Steps,
    check_start,
    choose_steps,
    columns_of,
    energies_of,
    is_stably_integrated,
    simulate,
)
from netboard.recording.files.locate import sha256_of
from netboard.recording.importing.hand_files import (
    find_inputs,
    plan_outputs,
    read_hands,
    velocity_warnings,
    write_table,
)

SHOWN = {"z": "m", "theta": "rad", "p": "m", "f_left": "N", "f_right": "N"}
"""Signals whose range is shown, with their units."""


@dataclass(frozen=True)
class SimulationOptions:
    """The options of ``netboard simulate``; `board0` is z0, vz0, theta0, omega0."""

    hold: str
    gaps: str
    method: str
    dt: float
    substeps: int
    ball: str
    board0: tuple[float, ...]
    p0: tuple[float, ...]
    v0: tuple[float, ...]
    energy: bool

    def __post_init__(self) -> None:
        if self.energy and self.hold != "hermite":
            raise ConfigError(
                f"--energy: found --hold {self.hold}, expected hermite: otherwise the hands move in jumps"
            )

    @property
    def free(self) -> bool:
        """Return whether the balls roll."""
        return self.ball == "free"

    def start(self, balls: int) -> tuple[float, ...]:
        """Return the initial state; balls start at rest at the centre by default."""
        if any(len(given) not in (0, balls) for given in (self.p0, self.v0)):
            raise ConfigError(
                f"--p0, --v0: found {len(self.p0)} and {len(self.v0)} values, expected none or one for each ball; "
                f"the scene has {balls} (physics.balls)"
            )
        pairs = zip(self.p0 or (0.0,) * balls, self.v0 or (0.0,) * balls, strict=True)
        return (*self.board0, *(value for pair in pairs for value in pair))


def load_scene(file: Path | None, overrides: Sequence[str]) -> Config:
    """Read a scene: of a configuration only the table [physics] counts; without a file, the paper's scene."""
    source = str(file or "defaults")
    config = read(ADAPTER, Config, read_text(file) if file else "", source, overrides)
    if problems := [f"{source}: {problem}" for problem in contradictions_of_scene(config.physics)]:
        raise ConfigError("\n".join(problems))
    return config


Tell = Callable[[str, float], None]
"""Progress callback: what is being done, and the share done [1]."""

Sheet = dict[str, str]
"""Summary of one file, by heading."""


def simulate_files(
    inputs: Sequence[str], output: str, config: Config, chosen: SimulationOptions, force: bool
) -> Iterator[RenderableType]:
    """Simulate files, and yield what to print; in the end raise an error with the faults of those that are invalid."""
    physics, free = config.physics, chosen.free
    check_start(physics, chosen.start(physics.balls), free)
    steps = choose_steps(physics, free, chosen.method, chosen.substeps)
    plan = plan_outputs(find_inputs(inputs), output, force)
    sheets: list[Sheet] = []
    faults: list[str] = []
    with telling() as tell:
        for number, (path, result) in enumerate(plan.items()):

            def tell_share(what: str, share: float, number: int = number, path: Path = path) -> None:
                tell(f"{what} {path.name}", number + share, len(plan))

            try:
                sheet, notes = simulate_file(path, result, config, steps, chosen, force, tell_share)
            except ConfigError as fault:
                faults.append(str(fault))
                continue
            sheets.append(sheet)
            yield from (Text(f"{path}: {note}", style="yellow") for note in notes)
    if sheets:
        yield from (scene_in_words(physics, free), steps_in_words(steps, chosen), table_of(sheets))
    if faults:
        raise ConfigError("\n".join(faults))


def simulate_file(
    path: Path, result: Path, config: Config, steps: Steps, chosen: SimulationOptions, force: bool, tell: Tell
) -> tuple[Sheet, list[str]]:
    """Simulate one file; return its summary, and warnings."""
    began, physics, free = time.monotonic(), config.physics, chosen.free
    tell("reading", 0.0)
    hands = read_hands(path, chosen.gaps)
    start, progress = chosen.start(physics.balls), partial(tell, "simulating")
    try:
        motion = simulate(
            hands, physics, start, free=free, hold=chosen.hold, dt=chosen.dt, steps=steps, progress=progress
        )
        energies = energies_of(motion, hands, physics, free) if chosen.energy else {}
    except ConfigError as fault:
        raise ConfigError(f"{path}: {fault}") from None
    columns, sheet = columns_of(motion), sheet_of(path, hands, motion)
    if chosen.energy:
        columns.update(energies)
        sheet["energy"] = balance(energies)
    tell("writing", 1.0)
    write_table(result, columns, provenance(path, config, chosen), force)
    notes = velocity_warnings(hands)
    if not is_stably_integrated(motion, physics, free):
        step = f"{motion.longest * 1e3:.3g} ms"
        notes.append(f"{steps.method} is unstable for this scene in steps of {step}: the result is invalid")
    return {**sheet, "took": f"{time.monotonic() - began:.2f} s", "result": str(result)}, notes


def provenance(path: Path, config: Config, chosen: SimulationOptions) -> dict[str, str]:
    """Return how a result was made, for its file."""
    options = {name: str(value) for name, value in asdict(chosen).items()}
    made = {"made_by": f"netboard {version('netboard')} simulate", "input": str(path)}
    return {**made, "input_sha256": sha256_of(path), **options, "configuration": resolve(config)}


# --- descriptions ------------------------------------------------------------------------------------------------


def scene_in_words(physics: Physics, free: bool) -> str:
    """Describe the scene."""
    balls = f"{physics.balls} {'free' if free else 'fixed'} ball{'' if physics.balls == 1 else 's'}"
    return f"{physics.model} model, {physics.board} board, {balls if physics.balls else 'no ball'}"


def steps_in_words(steps: Steps, chosen: SimulationOptions) -> str:
    """Describe the steps, and why they were chosen."""
    if chosen.method != "auto":
        return f"{steps.method}, as requested"
    if np.isinf(steps.longest):
        return f"{steps.method}, in steps and orders that keep its error below {TOLERANCE:g} of the speed"
    why = f", {steps.longest * steps.fastest:.2g} of its shortest time constant" if steps.fastest else ""
    return f"{steps.method} in steps of at most {steps.longest * 1e3:.3g} ms{why}"


def sheet_of(path: Path, hands: Hands, motion: Motion) -> Sheet:
    """Summarise inputs and outputs."""
    intervals = np.diff(hands.t) * 1e3
    low, high, usual = intervals.min(), intervals.max(), np.median(intervals)
    columns = columns_of(motion)
    return {
        "input": str(path),
        "samples": str(len(hands.t)),
        "lasts": f"{hands.t[-1] - hands.t[0]:.6g} s",
        "every": f"{usual:.4g} ms" if high - low < 1e-3 * usual else f"{low:.4g} to {high:.4g} ms",
        "rows": str(len(motion.t)),
        "steps": f"{motion.count}, at most {motion.longest * 1e3:.3g} ms",
        **{
            f"{name} [{unit}]": f"{columns[name].min():.3g} to {columns[name].max():.3g}"
            for name, unit in SHOWN.items()
            if name in columns
        },
    }


def balance(energies: Mapping[str, NDArray[np.float64]]) -> str:
    """Return how well energies and works agree."""
    stored = np.sum([column for name, column in energies.items() if name.startswith("E_")], axis=0)
    worked = np.sum([column for name, column in energies.items() if name.startswith("W_")], axis=0)
    return f"balanced to {np.abs(stored - stored[0] - worked).max():.2g} J; it varies by {np.ptp(stored):.3g} J"


def table_of(sheets: Sequence[Sheet]) -> FittedTable:
    """Show one sheet from top to bottom; for several, a row each with what may be unusual about one."""
    if len(sheets) == 1:
        return FittedTable("", "", rows=sheets[0].items(), header=False)
    names = [name for name in sheets[0] if name in ("input", "samples", "lasts", "theta [rad]", "p [m]", "took")]
    return FittedTable(*names, rows=[[sheet[name] for name in names] for sheet in sheets])
