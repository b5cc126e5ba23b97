"""``make evidence ARGS=forces``: commanded forces of both hands in one movement under each force condition.

Two hands move the ball from one target to the other along a smooth path; the right hand contributes more than the left,
and both sway up and down together. The same samples are the input of stages that differ only in the force
condition, without sockets and clocks, so the figure is the same on every machine. The unrelated force is that of
another movement.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config
from netboard.base.looks import PRINT_BODY, PRINT_TITLE
from netboard.base.tables import forces
from netboard.base.tables.forces import FORCES, Force
from netboard.base.tick import STATE, TICK_SECONDS
from netboard.benchmarks.harness.results import BenchVerdict, Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.recording.movement import FIRST_MOVEMENT, SECOND_MOVEMENT, Rows, record
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Phase

CONDITIONS: tuple[Force, ...] = (*(force for force in FORCES if force != "none"), "none")

TICKS, QUICK_TICKS = 4300, 2000
"""Ticks of the movement [1]."""

SETTLED = 100
"""Ticks after which the transient of the start has decayed; only later ticks are compared [1]."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the movement under all conditions."""
    count = QUICK_TICKS if quick else TICKS
    tell("a movement, and another one", 0.0)
    config = _config("full")
    samples, others = record(config, FIRST_MOVEMENT, count), record(config, SECOND_MOVEMENT, count)
    for side in SIDES:
        samples[f"{side}_other"] = others[f"{side}_force"]
    found = {}
    for step, force in enumerate(CONDITIONS):
        tell(f"forces: {force}", step / len(CONDITIONS))
        found[force] = played(_config(force), samples)
    folder.save("forces", lambda: draw(found))
    yield conditions_part(found)


def _config(force: Force) -> Config:
    """Return the paper's block with the ball on the left, and a force condition."""
    block = replace(Config().block, first_target="right", force=force)
    return replace(Config(), block=replace(block, unrelated="another" if forces.CONDITIONS[force].recorded else ""))


def played(config: Config, samples: Rows) -> Rows:
    """Return the rows that a stage computes from samples."""
    stage, rows = make_stage(config), samples.copy()
    stage.advance(stage.initial(), rows, 0, len(rows))
    return rows


def forces_of(rows: Rows) -> NDArray[np.float64]:
    """Return the forces on both hands."""
    return np.stack([rows["left_force"], rows["right_force"]], axis=1)


def conditions_part(found: dict[Force, Rows]) -> ResultPart:
    """Return mean and largest forces, and the claims about them."""
    rows: list[tuple[Value, ...]] = []
    for force, ticks in found.items():
        felt = forces_of(ticks)[SETTLED:]
        rms = np.sqrt(np.mean(felt**2, axis=0))
        mean = felt.mean(axis=0)
        rows.append((force, *mean.tolist(), *rms.tolist(), float(np.abs(felt).max())))
    heads = (*(f"mean, {side} [N]" for side in SIDES), *(f"rms, {side} [N]" for side in SIDES), "largest [N]")
    return ResultPart("conditions", "What both hands feel of one movement", ("", *heads), rows, _verdicts(found))


def _verdicts(found: dict[Force, Rows]) -> list[BenchVerdict]:
    states = {b"".join(ticks[name].tobytes() for name in STATE.names or ()) for ticks in found.values()}
    left = residual(found)
    rms, largest = float(np.sqrt(np.mean(left**2))), float(np.abs(left).max())
    recorded = np.stack([found["unrelated"][f"{side}_other"] for side in SIDES], axis=1)
    nothing = not forces_of(found["none"]).any()
    alike = bool(np.array_equal(forces_of(found["unrelated"])[SETTLED:], recorded[SETTLED:]))
    return [
        BenchVerdict(
            "board, ball and trial are bit-identical in all conditions", len(states) == 1, f"{len(states)} result"
        ),
        BenchVerdict(
            "partner_only + environment_only equals full except for damping and inertia",
            rms < 0.02,
            f"difference: rms {1e3 * rms:.1f} mN, maximum {1e3 * largest:.1f} mN",
        ),
        BenchVerdict("the unrelated force is the recorded one", alike, "to the bit" if alike else "they differ"),
        BenchVerdict("none renders no force", nothing, "0 N" if nothing else "a force is not 0"),
    ]


def residual(found: dict[Force, Rows]) -> NDArray[np.float64]:
    """Return the difference between the full force and the sum of its two parts at rest."""
    full, partner, environment = (forces_of(found[name]) for name in ("full", "partner_only", "environment_only"))
    return (full - partner - environment)[SETTLED:]


_COLOURS: dict[Force, str] = {force: f"C{place}" for place, force in enumerate(CONDITIONS, -1)} | {
    "full": "black",
    "none": "tab:gray",
}


def draw(found: dict[Force, Rows]) -> Any:
    """Draw the movement and the commanded forces of both hands."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 9), layout="constrained")
    moved, *felt = figure.subplots(3, 1, sharex=True, height_ratios=(1.0, 1.3, 1.3))
    shown = {force: rows[SETTLED:] for force, rows in found.items()}
    ticks = shown["full"]
    t = ticks["tick"] * TICK_SECONDS
    moved.plot(t, 1e3 * ticks["left_used_z"], color="tab:purple", label="left stylus")
    moved.plot(t, 1e3 * ticks["right_used_z"], color="tab:red", label="right stylus")
    moved.set_ylabel("height of the styluses (mm)")
    ball = moved.twinx()
    ball.plot(t, 1e3 * ticks["p"], color="tab:brown", linestyle="--", label="ball (right scale)")
    ball.set_ylabel("ball along the board (mm)")
    lines = [*moved.get_lines(), *ball.get_lines()]
    moved.legend(lines, [str(line.get_label()) for line in lines], fontsize=PRINT_BODY, loc="upper left")
    for place, (side, axis) in enumerate(zip(SIDES, felt, strict=True)):
        for force, rows in shown.items():
            axis.plot(t, forces_of(rows)[:, place], color=_COLOURS[force], label=force, linewidth=1.4)
        parts = forces_of(shown["partner_only"]) + forces_of(shown["environment_only"])
        axis.plot(t, parts[:, place], color="white", linestyle=":", linewidth=1.0, label="partner + environment")
        axis.set_ylabel(f"force on the {side} hand (N), + = up")
        axis.grid(True, alpha=0.3)
    for axis in (moved, *felt):
        for phase, colour in ((Phase.LEVELLING, "0.92"), (Phase.HOLDING, "0.96")):
            axis.fill_between(
                t, 0, 1, where=ticks["phase"] == phase, color=colour, transform=axis.get_xaxis_transform(), zorder=0
            )
    handles, labels = felt[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=PRINT_TITLE, ncols=6, loc="outside lower center", facecolor="0.85")
    shading = "shaded: the board is being levelled, the ball is in its target"
    moved.set_title(f"one movement, {len(CONDITIONS)} force conditions ({shading})")
    felt[-1].set_xlabel("time since the start of the block (s)")
    return figure
