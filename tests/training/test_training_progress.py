"""Progress of a training: what it may be resumed with, and that a kill at any time loses no finished round."""

from dataclasses import replace
from pathlib import Path

import pytest

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.training import progress
from netboard.training.progress import (
    CHECKPOINTS,
    PROGRESS,
    TrainingFolder,
    TrainingInputs,
    TrainingRequest,
    TrainingRound,
)

INPUTS = TrainingInputs(TrainingRequest(seed=4), "ab" * 32, parse("[block]\nforce = 'none'\n"))


class Killed(BaseException):
    """Stands in for the end of a process."""


def round_of(number: int) -> TrainingRound:
    """Return a round without a successful episode."""
    return TrainingRound(number, 64 * number, 3, 0.0, 1.0, float("nan"), 0.2, 1.0, 2.0)


def saved(folder: TrainingFolder, number: int) -> None:
    """Save a round."""

    def write(path: Path) -> None:
        path.write_text(f"checkpoint {number}")

    folder.save(round_of(number), write)


def resumed(folder: Path, inputs: TrainingInputs = INPUTS) -> TrainingFolder:
    """Resume a training."""
    return TrainingFolder(folder, inputs, resume=True)


def test_training_is_resumed_with_its_rounds_and_newest_checkpoint(tmp_path: Path) -> None:
    begun = TrainingFolder(tmp_path / "new", INPUTS)
    assert begun.checkpoint is None
    for number in (1, 2):
        saved(begun, number)
    found = resumed(tmp_path / "new")
    assert [one.round for one in found.curve] == [1, 2]
    assert found.checkpoint is not None
    assert found.checkpoint.read_text() == "checkpoint 2"
    assert [path.name for path in begun.path.glob(CHECKPOINTS)] == ["checkpoint-2.pt"]


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        (replace(INPUTS, request=TrainingRequest(seed=2)), "seed: found 2, expected 4"),
        (replace(INPUTS, posterior="cd" * 32), "posterior: found SHA-256 cdcdcdcdcdcd, expected abababababab"),
        (replace(INPUTS, config=Config()), '[block] force: found "full", expected "none"'),
    ],
)
def test_other_inputs_are_refused_and_named(tmp_path: Path, inputs: TrainingInputs, said: str) -> None:
    saved(TrainingFolder(tmp_path, INPUTS), 1)
    with pytest.raises(ConfigError) as refusal:
        resumed(tmp_path, inputs)
    assert str(refusal.value).endswith(f"cannot be resumed with other inputs than it was begun with: {said}")
    assert len(resumed(tmp_path).curve) == 1, "a refused resumption changes nothing"


@pytest.mark.parametrize("at", ["checkpoint", "progress", "clean-up"])
def test_kill_while_a_round_is_saved_loses_no_round_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    begun = TrainingFolder(tmp_path, INPUTS)
    saved(begun, 1)

    def killed(*_: object) -> None:
        raise Killed

    def write(path: Path) -> None:
        path.write_text("checkpoint 2")
        if at == "checkpoint":
            killed()

    with monkeypatch.context() as patched:
        if at == "progress":
            patched.setattr(progress, "write_synced", killed)
        if at == "clean-up":
            patched.setattr(Path, "glob", killed)
        with pytest.raises(Killed):
            begun.save(round_of(2), write)
    found = resumed(tmp_path)
    rounds = 2 if at == "clean-up" else 1
    assert len(found.curve) == rounds
    assert found.checkpoint is not None
    assert found.checkpoint.read_text() == f"checkpoint {rounds}"
    saved(found, rounds + 1)
    assert resumed(tmp_path).checkpoint == tmp_path / f"checkpoint-{rounds + 1}.pt"


@pytest.mark.parametrize("resume", [True, False])
def test_training_begins_in_an_empty_folder(tmp_path: Path, resume: bool) -> None:
    (tmp_path / ".progress.json.17.part").touch()  # of a process that was killed as it began
    assert TrainingFolder(tmp_path, INPUTS, resume=resume).curve == []
    assert resumed(tmp_path).curve == []
    with pytest.raises(ConfigError, match=r"has a training already; .* --resume"):
        TrainingFolder(tmp_path, INPUTS)


def test_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with pytest.raises(ConfigError, match="other files, expected that of netboard train partner"):
        resumed(tmp_path)
    with pytest.raises(ConfigError, match="other files, expected a new or an empty one"):
        TrainingFolder(tmp_path, INPUTS)
    with pytest.raises(ConfigError, match="Not a directory"):
        resumed(tmp_path / "notes.txt")


def test_finished_training_is_not_resumed(tmp_path: Path) -> None:
    TrainingFolder(tmp_path, INPUTS)
    (tmp_path / "weights.json").touch()
    with pytest.raises(ConfigError, match="this training is finished"):
        resumed(tmp_path)


def test_checkpoint_of_another_round_and_broken_progress_are_refused(tmp_path: Path) -> None:
    saved(TrainingFolder(tmp_path, INPUTS), 1)
    (tmp_path / "checkpoint-1.pt").write_text("another")
    with pytest.raises(ConfigError, match=r"checkpoint-1.pt: expected the checkpoint that progress.json names"):
        assert resumed(tmp_path).checkpoint
    (tmp_path / "checkpoint-1.pt").unlink()
    with pytest.raises(ConfigError, match=r"checkpoint-1.pt: cannot be read: No such file"):
        assert resumed(tmp_path).checkpoint
    for text in ("{}", "[]", "{"):
        (tmp_path / PROGRESS).write_text(text)
        with pytest.raises(ConfigError, match=r"progress.json: expected the progress of netboard train partner"):
            resumed(tmp_path)
