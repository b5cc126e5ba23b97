"""Training where its libraries are installed: very short, resumed with the same bits, and evaluated."""

import hashlib
import json
from math import isnan, nan
from pathlib import Path

import pytest
from typer.testing import CliRunner

from made_network import made_network, made_text

pytest.importorskip("stable_baselines3", reason="needs netboard[train]")

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.participants.robots.learned import read_weights
from netboard.services.cli import app
from netboard.training.learning import Training
from netboard.training.population import HELD_OUT, Population
from netboard.training.progress import PROGRESS, TrainingFolder, TrainingInputs, TrainingRequest
from netboard.training.selection import RoundPlayed, best_round, play_round
from netboard.training.session import TrainingSession
from netboard.training.weights import write_weights

pytestmark = pytest.mark.slow

SHORT = TrainingRequest(rounds=2, updates=1, people=2, boards=16, units=8)


def people(seed: int = 1) -> list:
    from netboard.analysis.cohort.posterior import read_posterior

    return Population(read_posterior(), Config().participant).learning(seed, SHORT.people)


def training(folder: Path, request: TrainingRequest = SHORT, *, resume: bool = False) -> Training:
    inputs = TrainingInputs(request, "ab" * 32, Config())
    return Training(request, Config(), people(), TrainingFolder(folder, inputs, resume=resume))


def weights(trained: Training) -> bytes:
    return b"".join(array.tobytes() for layer in trained.network().layers for array in layer)


def test_resumed_training_has_the_bits_of_one_that_was_not_interrupted(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    whole = training(one)
    assert [found.steps for found in whole.rounds()] == [2048, 4096]
    next(training(two).rounds())
    resumed = training(two, resume=True)
    assert [found.round for found in resumed.rounds()] == [2]
    assert weights(resumed) == weights(whole)


def test_checkpoint_that_is_none_of_pytorch_is_refused(tmp_path: Path) -> None:
    next(training(tmp_path).rounds())
    checkpoint, progress = tmp_path / "checkpoint-1.pt", tmp_path / PROGRESS
    before = hashlib.sha256(checkpoint.read_bytes()).hexdigest()
    checkpoint.write_bytes(b"no checkpoint")
    progress.write_text(progress.read_text().replace(before, hashlib.sha256(b"no checkpoint").hexdigest()))
    with pytest.raises(ConfigError, match=r"checkpoint-1.pt: expected a checkpoint of this training"):
        training(tmp_path, resume=True)


def test_training_leaves_weights_with_a_card_a_table_and_a_figure(tmp_path: Path) -> None:
    folder = tmp_path / "trained"
    session = TrainingSession(SHORT, Config(), "bimanual_off", folder)
    found = session.run(lambda *_: None, held_out=1, trials=1)
    network, sha256 = read_weights(str(folder / "weights.json"))
    assert network.sizes == (15, 8, 8, 1)
    assert len(sha256) == 64
    assert network.card["evaluated beside participants that were held out"]["trials"] == found.trials
    head, *rounds = (folder / "curve.csv").read_text().splitlines()
    assert head.endswith("stable_ms,played_seconds")
    assert len(rounds) == SHORT.rounds
    kept = network.card["trained on"]["round"]
    assert read_weights(str(folder / f"round-{kept}.json"))[0].layers[0][0].tolist() == network.layers[0][0].tolist()
    assert (folder / "curve.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ConfigError, match="has a training already"):
        TrainingSession(SHORT, Config(), "bimanual_off", folder)
    with pytest.raises(ConfigError, match="this training is finished"):
        TrainingSession(SHORT, Config(), "bimanual_off", folder, resume=True)


def test_training_that_was_stopped_in_its_last_round_has_its_whole_curve(tmp_path: Path) -> None:
    def stop(words: str, done: int, rounds: int) -> None:
        if done == rounds:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        TrainingSession(SHORT, Config(), "bimanual_off", tmp_path / "cut").run(stop, held_out=1, trials=1)
    resumed = TrainingSession(SHORT, Config(), "bimanual_off", tmp_path / "cut", resume=True)
    resumed.run(lambda *_: None, held_out=1, trials=1)
    _, *rounds = (tmp_path / "cut" / "curve.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in rounds] == ["1", "2"]


def test_best_round_is_the_fastest_that_is_stable() -> None:
    assert best_round([RoundPlayed(77, 2.6), RoundPlayed(107, 2.0), RoundPlayed(60, 2.1), RoundPlayed(-1, nan)]) == 2
    with pytest.raises(ConfigError, match=r"the network of no round steers stably with late views: .* up to -1, 12 ms"):
        best_round([RoundPlayed(-1, nan), RoundPlayed(12, nan)])


def test_an_unstable_round_does_not_play(tmp_path: Path) -> None:
    write_weights(tmp_path / "round-1.json", made_network(units=(8, 8)))
    stable_ms, seconds = play_round(tmp_path / "round-1.json", people(), Config())
    assert stable_ms < 24
    assert isnan(seconds)


def test_participants_to_learn_beside_are_never_held_out() -> None:
    from netboard.analysis.cohort.posterior import read_posterior

    population = Population(read_posterior(), Config().participant)
    assert not set(population.learning(3, 8)) & set(population.held_out(8))
    assert population.learning(3, 2) != population.learning(4, 2)
    assert HELD_OUT > 0


def test_onnx_export_agrees_with_the_kernel(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", reason="needs netboard[onnx]")
    from netboard.training.onnx import largest_difference, write_onnx

    network = made_network(units=(32, 32))
    write_onnx(tmp_path / "partner.onnx", network, "0" * 64)
    assert largest_difference(tmp_path / "partner.onnx", network, 1000) < 2e-5  # float32, and outputs up to 20


def test_commands_refuse_what_is_no_file_of_weights(tmp_path: Path) -> None:
    broken = tmp_path / "weights.json"
    broken.write_text(made_text()[:-100])
    for command in (["evaluate", str(broken)], ["onnx", str(broken), str(tmp_path / "x.onnx")]):
        result = CliRunner().invoke(app, ["train", *command])
        assert result.exit_code == 2, result.output
        assert "cut off" in result.output
    assert json.loads(made_text())["version"] == 1
