"""Parameters and behaviour of the simulated participants beside what others measured or used in models."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from netboard.base.config import Config
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import Part
from netboard.benchmarks.participants.paper import Sample
from netboard.participants.partner import haptic_weight

NEWTON_PER_METRE = 25.93
"""Change of one's own force per displacement of the partner's hand, at rest, in the paper's scene [N/m]."""


def others_part(sample: Sample, person: Participant, config: Config) -> Part:
    """Tabulate the comparisons."""
    rows = [*_parameters(person, config), *_behaviour(sample)]
    columns = ("quantity", "model", "others, low", "others, high", "agrees", "source")
    return Part("others", "Beside measurements and models of others", columns, rows)


def _row(name: str, value: float, low: float, high: float, source: str) -> tuple[Any, ...]:
    """Return a row with whether the value lies in the range."""
    return name, float(value), low, high, "yes" if low <= value <= high else "NO", source


def _parameters(person: Participant, config: Config) -> Iterator[tuple[Any, ...]]:
    """Yield the parameters that others measured."""
    yield _row("visual delay [s]", person.visual_delay, 0.08, 0.23, "models: Takagi 2017, Lokesh 2023, Insperger")
    yield _row("haptic delay [s]", person.haptic_delay, 0.05, 0.1, "Cluff, Crevecoeur and Scott 2015; Lokesh 2023")
    yield _row("delay of the reflexes [s]", person.reflex_delay, 0.025, 0.1, "Cluff, Crevecoeur and Scott 2015")
    yield _row("refractory time [s]", person.refractory, 0.25, 0.55, "van de Kamp et al. 2013, plants of order 0 to 2")
    yield _row("muscle lag [s]", person.muscle_lag, 0.04, 0.04, "Lokesh 2023, model")
    felt = person.haptic_noise * NEWTON_PER_METRE
    yield _row("noise of a felt force [N]", felt, 0.02, 0.05, "7 to 10 % (Pang, Tan and Durlach 1991) of 0.3 to 0.5 N")
    seen = 2.0 * config.physics.l * np.radians(person.tilt_noise_deg)
    drift = (person.partner_noise * config.physics.l * np.radians(person.max_tilt_deg)) ** 2 / person.movement_time
    gain = haptic_weight(seen, drift, person.visual_delay - person.haptic_delay, person.haptic_noise)
    yield _row("weight of touch for the partner's height", gain, 0.5, 1.0, "touch dominates: Crevecoeur et al. 2016")


def _behaviour(sample: Sample) -> Iterator[tuple[Any, ...]]:
    """Yield what the participants did that others measured."""
    alone = float(sample.of("peaks", "bimanual").sum() / sample.of("completion", "bimanual").sum())
    first, sparc = (float(np.nanmedian(sample.of(name, "bimanual"))) for name in ("first_move", "sparc"))
    yield _row("first movement of the board after the release, median [s]", first, 0.2, 0.6, "reaction and muscle lags")
    yield _row("SPARC of the ball's speed, bimanual, median", sparc, -2.5, -1.41, "one smooth movement: -1.41 at most")
    yield _row("velocity peaks per second, bimanual", alone, 0.69, 0.88, "this paper: 3.92/5.71 to 3.17/3.61")
    levels = [sample.levels("completion", dyad, True) for dyad in sample.dyads]
    share = float(np.mean([both < min(a, b) for a, b, both in levels]))
    source = "Ganesh et al. 2014: better with a worse partner, too"
    yield _row("share of dyads faster than their better participant, haptics on", share, 0.5, 1.0, source)
