"""A posterior of the participants' parameters: its file, and participants drawn from it.

The file is JSON: the parameters, a draw on each line, and the identity of the fit. The one of the paper's bimanual
results with haptic feedback off comes with netboard.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import ConfigError
from netboard.base.files.text import read_text
from netboard.base.settings import parse_json
from netboard.base.tables.simulated import Participant

PACKAGED = "bimanual_off"
"""Name of the posterior that comes with netboard."""


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Draws of a posterior.

    - `parameters`: the fitted keys of ``[participant]``.
    - `draws` (shape (n, k)): their values [their units].
    - `about`: identity of the fit.
    """

    parameters: tuple[str, ...]
    draws: NDArray[np.float64]
    about: Mapping[str, Any]

    def participant(self, usual: Participant, seed: int) -> Participant:
        """Draw a participant; what was not fitted is as usual."""
        return self.at(usual, int(np.random.default_rng(seed).integers(len(self.draws))))

    def at(self, usual: Participant, place: int) -> Participant:
        """Return the participant of one draw, by its place; what was not fitted is as usual."""
        return replace(usual, **dict(zip(self.parameters, self.draws[place].tolist(), strict=True)))

    @property
    def sha256(self) -> str:
        """Return the SHA-256 of the file, in hexadecimal."""
        return hashlib.sha256(self.text().encode()).hexdigest()

    def text(self) -> str:
        """Return the content of a file."""
        head = json.dumps({**self.about, "parameters": self.parameters}, indent=1, ensure_ascii=False)
        rows = ",\n".join("  " + json.dumps([float(f"{value:.5g}") for value in row]) for row in self.draws)
        return f'{head.removesuffix("}").rstrip()},\n "draws": [\n{rows}\n ]\n}}\n'


def read_posterior(source: str = PACKAGED) -> Posterior:
    """Read a posterior: a file, or the one that comes with netboard, by its name.

    - raises ConfigError: if it is no posterior of parameters that participants have.
    """
    if source == PACKAGED:
        text = (files(__package__) / f"{PACKAGED}.json").read_text(encoding="utf-8")
    else:
        text = read_text(
            Path(source), f"no such file; expected the posterior.json of netboard participants fit, or {PACKAGED}"
        )
    try:
        about = dict(parse_json(text))
        names, draws = tuple(about.pop("parameters")), np.array(about.pop("draws"), np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(f"{source}: expected a posterior of netboard participants fit ({error!r})") from error
    known = {field.name for field in fields(Participant)}
    if unknown := sorted(set(names) - known):
        raise ConfigError(f"{source}: found the parameters {', '.join(unknown)}, which [participant] does not have")
    if draws.ndim != 2 or not len(draws) or draws.shape[1] != len(names):
        raise ConfigError(f"{source}: draws: found the shape {draws.shape}, expected (n, {len(names)})")
    for values in (draws.min(axis=0), draws.max(axis=0)):
        lines = [f"participant.{name}={value!r}" for name, value in zip(names, values.tolist(), strict=True)]
        parse("", source, lines)
    return Posterior(names, draws, about)
