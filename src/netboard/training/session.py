"""A training from begin to end: it learns, is evaluated, and leaves weights, card and learning curve in a folder."""

from dataclasses import replace
from pathlib import Path

from netboard.analysis.cohort.posterior import read_posterior
from netboard.base.config import Config
from netboard.participants.robots.learned import read_weights
from netboard.training.evaluation import Evaluation, Tell, evaluate
from netboard.training.learning import Training
from netboard.training.population import HELD_OUT, Population
from netboard.training.progress import TrainingFolder, TrainingInputs, TrainingRequest
from netboard.training.results import card_of, write_curve
from netboard.training.selection import PLAYED_WITH, RoundPlayed, best_round, play_round
from netboard.training.weights import WEIGHTS, weights_of_round, write_weights


class TrainingSession:
    """A training in a folder: a new one, or with ``resume`` one that was interrupted there."""

    def __init__(
        self, request: TrainingRequest, config: Config, posterior: str, folder: Path, *, resume: bool = False
    ) -> None:
        self._request, self._config, self._folder = request, config, folder
        self._posterior = read_posterior(posterior)
        self._population = Population(self._posterior, config.participant)
        self._people = self._population.learning(request.seed, request.people)
        inputs = TrainingInputs(request, self._posterior.sha256, config)
        self._training = Training(request, config, self._people, TrainingFolder(folder, inputs, resume=resume))

    def run(self, tell: Tell, *, held_out: int, trials: int) -> Evaluation:
        """Run the rounds that are missing, keep the best one, and evaluate it; return its results."""
        rounds = self._request.rounds
        played = [self._play(one.round) for one in self._training.curve]
        for done in self._training.rounds():
            played.append(self._play(done.round))
            tell(f"round {done.round} of {rounds}: {played[-1]}", done.round, rounds)
            write_curve(self._folder, self._training.curve, played)
        write_curve(self._folder, self._training.curve, played)  # if all rounds were done, and the last one was cut off
        kept = self._training.curve[best_round(played) - 1]
        weights = weights_of_round(self._folder, kept.round)
        found = evaluate(weights, self._population.held_out(held_out), self._config, trials, tell)
        beside = {
            "participants": f"{self._request.people} of the posterior {self._posterior.sha256}, drawn with seeds below "
            f"{HELD_OUT}",
            "force": self._config.block.force,
        }
        card = card_of(self._request, beside, kept, self._training.curve[-1].cpu_seconds, found)
        write_weights(self._folder / WEIGHTS, replace(read_weights(str(weights))[0], card=card))
        return found

    def _play(self, number: int) -> RoundPlayed:
        """Let the network of a round play beside some participants that it learned with."""
        return play_round(weights_of_round(self._folder, number), self._people[:PLAYED_WITH], self._config)
