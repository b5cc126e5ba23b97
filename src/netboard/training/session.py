"""A training from begin to end: it learns, is evaluated, and leaves weights, card and learning curve in a folder."""

from pathlib import Path

from netboard.analysis.cohort.posterior import read_posterior
from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import refuse_existing
from netboard.training.evaluation import Evaluation, Tell, evaluate
from netboard.training.learning import PROGRESS, Training, TrainingRequest
from netboard.training.population import HELD_OUT, Population
from netboard.training.results import WEIGHTS, card_of, write_curve, write_weights


class TrainingSession:
    """A training in a folder: a new one, or with ``resume`` one that was interrupted there."""

    def __init__(
        self, request: TrainingRequest, config: Config, posterior: str, folder: Path, *, resume: bool = False
    ) -> None:
        self._request, self._config, self._folder = request, config, folder
        self._posterior = read_posterior(posterior)
        self._population = Population(self._posterior, config.participant)
        if resume:
            refuse_existing(folder / WEIGHTS, ": this training is finished")
        elif (folder / PROGRESS).exists():
            raise ConfigError(f"{folder}: has a training already; name another folder, or continue it by --resume")
        else:
            refuse_existing(folder)
            with writing(folder, NetboardError):
                folder.mkdir(parents=True)
        people = self._population.learning(request.seed, request.people)
        self._training = Training(request, config, people, folder, resume=resume)

    def run(self, tell: Tell, *, held_out: int, trials: int) -> Evaluation:
        """Run the rounds that are missing, and evaluate the partner; return its results."""
        rounds = self._request.rounds
        for done in self._training.rounds():
            tell(f"round {done.round} of {rounds}: {done.success:.0%} successful", done.round, rounds)
            write_curve(self._folder, self._training.curve)
        draft = self._folder / f"draft-{WEIGHTS}"
        write_weights(draft, self._training.network(), force=True)
        people = self._population.held_out(held_out)
        found = evaluate(draft, people, self._config, trials, tell)
        beside = {
            "participants": f"{self._request.people} of the posterior {self._posterior.sha256}, drawn with seeds below "
            f"{HELD_OUT}",
            "force": self._config.block.force,
        }
        card = card_of(self._request, beside, self._training.curve, found)
        write_weights(self._folder / WEIGHTS, self._training.network(card))
        draft.unlink()
        return found
