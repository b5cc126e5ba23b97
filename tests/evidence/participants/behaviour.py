"""What the simulated participants do besides the paper's results: order of the conditions, hands at rest, and others.

The tables are of the dyads that `evidence.participants.bench` has performed.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from evidence.participants.paper import CONFIGURATIONS, Sample
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import ResultPart

LONG_REST = 2.0
"""Time for which people do not hold a hand still in a trial [s]."""


def order_part(sample: Sample) -> ResultPart:
    """Tabulate how the haptic effect on the completion time depends on the condition that performers begin with."""
    part = ResultPart(
        "order",
        "Haptic effect on the completion time by the condition that a participant or dyad begins with; "
        "95 % CI of the ratio (Welch)",
        "configuration | participants or dyads | begins on: on/off - 1 [%] | begins off: on/off - 1 [%] "
        "| ratio of both on/off - 1 [%] | 95 % CI low | 95 % CI high",
    )
    for configuration in CONFIGURATIONS:
        began_on, effects = sample.haptic_effects(configuration)
        on, off = effects[began_on], effects[~began_on]
        gap = stats.ttest_ind(on, off, equal_var=False)
        limits = gap.confidence_interval(0.95)
        numbers = (on.mean(), off.mean(), on.mean() - off.mean(), limits.low, limits.high)
        part.add(configuration, len(effects), *(100.0 * float(np.expm1(number)) for number in numbers))
    return part


def rest_part(rows: NDArray[Any]) -> ResultPart:
    """Tabulate how often the reading of a hand does not change for long."""
    part = ResultPart(
        "rest",
        f"Attempts in which the reading of a hand does not change for {LONG_REST:g} s or more",
        "configuration | haptics | attempts | share of them [%] | longest such time [s]",
    )
    for configuration in CONFIGURATIONS:
        for haptics in (False, True):
            chosen = ((rows["performer"] == "dyad") == (configuration == "dyadic")) & (rows["haptics"] == haptics)
            rest = rows["rest"][chosen]
            share = 100.0 * float(np.mean(rest >= LONG_REST))
            part.add(configuration, "on" if haptics else "off", len(rest), share, float(rest.max()))
    return part


def others_part(person: Participant) -> ResultPart:
    """Compare the delays of a participant with measurements and models of others."""
    part = ResultPart(
        "others",
        "Delays beside measurements and models of others",
        "quantity | model | others, low | others, high | agrees | source",
    )
    for name, value, low, high, source in (
        ("visual delay [s]", person.visual_delay, 0.08, 0.23, "models: Takagi 2017 (0.08), Lokesh 2023 (0.1)"),
        ("haptic delay [s]", person.haptic_delay, 0.05, 0.1, "Cluff, Crevecoeur and Scott 2015; Lokesh 2023"),
        ("delay of the responses to a force [s]", person.reflex_delay, 0.025, 0.1, "Cluff, Crevecoeur and Scott 2015"),
        ("refractory time [s]", person.refractory, 0.25, 0.55, "van de Kamp et al. 2013, plants of order 0 to 2"),
    ):
        part.add(name, float(value), low, high, "yes" if low <= value <= high else "NO", source)
    return part
