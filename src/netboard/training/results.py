"""Results of a training in its folder: the weights with their card, the learning curve as a table and a figure."""

from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from netboard.base.files.cells import CsvWriter
from netboard.base.files.figure import save_figure
from netboard.base.files.new import new_file
from netboard.training.evaluation import Evaluation
from netboard.training.progress import TrainingRequest, TrainingRound
from netboard.training.selection import RoundPlayed

CURVE, FIGURE = "curve.csv", "curve.png"
"""Files of the learning curve."""

NOT_FOR = (
    "It learned beside simulated participants on simulated devices only. It has been tried beside no person and on no "
    "real device: it is no evidence on people, and no safety function. Other scenes, tasks, force conditions or longer "
    "delays than those of the training are untested."
)
"""What a card says that weights must not be used for."""


def card_of(
    request: TrainingRequest, learned: dict[str, Any], kept: TrainingRound, cpu_seconds: float, evaluation: Evaluation
) -> dict[str, Any]:
    """Return the card of a partner.

    ``learned``: beside whom, and with what it was trained; ``kept``: the round whose weights it has; ``cpu_seconds``:
    of the whole training [s].
    """
    return {
        "trained on": learned | {"algorithm": "PPO", "round": kept.round, "steps": kept.steps} | asdict(request),
        "cpu seconds": round(cpu_seconds, 1),
        "evaluated beside participants that were held out": evaluation.as_dict(),
        "not to be used for": NOT_FOR,
    }


def write_curve(folder: Path, curve: Sequence[TrainingRound], played: Sequence[RoundPlayed]) -> None:
    """Write the learning curve, and how the network of each round plays, as a table; the curve as a figure, too."""
    with new_file(folder / CURVE, force=True) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = CsvWriter(file)
        writer.row((*(field.name for field in fields(TrainingRound)), *RoundPlayed._fields))
        writer.rows((*asdict(one).values(), *plays) for one, plays in zip(curve, played, strict=True))
    (folder / FIGURE).unlink(missing_ok=True)
    save_figure(figure_of({"": (curve, played)}), folder / FIGURE, 150)


def figure_of(trainings: dict[str, tuple[Sequence[TrainingRound], Sequence[RoundPlayed]]]) -> Figure:
    """Return a figure of some trainings, by name.

    It shows the share of successful episodes, their mean length, and how the network of each round plays; one that may
    not play has no point.
    """
    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    success, seconds, real = figure.subplots(1, 3, sharex=True)
    for name, (curve, played) in trainings.items():
        steps = [one.steps / 1e6 for one in curve]
        success.plot(steps, [one.success for one in curve], marker=".", label=name)
        seconds.plot(steps, [one.seconds for one in curve], marker=".")
        real.plot(steps, [one.played_seconds for one in played], marker=".")
    success.set(ylabel="Successful episodes [1]", ylim=(-0.02, 1.02))
    seconds.set(xlabel="Environment steps [10⁶]", ylabel="Mean length of these [s]")
    real.set(ylabel="Mean of trials of the real task [s]")
    for panel in (seconds, real):
        panel.set_ylim(bottom=0.0)
    if len(trainings) > 1:
        success.legend(title="Seed", fontsize="small")
    return figure
