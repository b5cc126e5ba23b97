"""The paper's measures of an attempt, computed by `analysis.measures` as the settings say.

Measures beyond the paper's are in `netboard.analysis.extraction.modern`.
"""

from math import nan

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.tables import Group, number, words
from netboard.analysis.extraction.trials import RATE, Take
from netboard.analysis.measures.braking import Braking, Strategy, first_braking
from netboard.analysis.measures.motion import Window
from netboard.analysis.measures.movements import classify, movement_times
from netboard.analysis.measures.peaks import Peaks, velocity_peaks


def peaks_of(take: Take, window: Window) -> Peaks:
    """Find the velocity peaks of the ball, as the settings say."""
    how = take.block.readings.peaks
    return velocity_peaks(
        take.found.speed[take.trial.window(window)],
        extrema=how.extrema,
        plateau=how.plateau,
        least_prominence=how.least_prominence,
        least_share=how.least_share,
    )


def classes_of(take: Take) -> NDArray[np.int8]:
    """Classify the movement of the styluses at each sample of the set window."""
    how = take.block.readings.movements
    window = take.trial.window(how.window)
    left, right = take.found.left_vz[window], take.found.right_vz[window]
    return classify(left, right, still_below=how.still_below, at_limit=how.at_limit)


def strategy_of(take: Take, braking: Braking) -> Strategy:
    """Find the first braking movement."""
    found = take.found
    return first_braking(take.turns, found.theta, found.p, found.vp, RATE, take.trial, braking=braking)


def _completion(take: Take) -> dict[str, float | str]:
    return {
        "completion": take.completion,
        "completion_source": take.source,
        "recorded_completion": take.attempt.completion,
        "entries": take.entries,
    }


def _peaks(take: Take) -> dict[str, float]:
    window = take.block.readings.peaks.window
    return {
        "peaks": peaks_of(take, window).count if take.knows(window) else nan,
        "peaks_whole": peaks_of(take, "whole").count,
    }


def _movements(take: Take) -> dict[str, float]:
    known = take.knows(take.block.readings.movements.window)
    times = movement_times(classes_of(take), RATE)
    return {name: getattr(times, name) if known else nan for name in times.__slots__}


def _strategy(take: Take) -> dict[str, float]:
    how = take.block.readings.strategy
    kinds: dict[str, Braking] = {"braking": how.braking, "turning_back": "rotation"}
    values: dict[str, float] = {}
    for prefix, braking in kinds.items():
        found = strategy_of(take, braking)
        distance = found.distance if how.distance == "signed" else found.absolute_distance
        values |= {f"{prefix}_distance": distance, f"{prefix}_velocity": found.velocity, f"{prefix}_onset": found.onset}
        values |= {"initial_onset": found.initial, "wrong_way": found.wrong_way}
    return values


PAPER = (
    Group(
        (
            number("completion", "completion time: from the release to the beginning of the hold", "s"),
            words("completion_source", "samples, or recording where these show no hold; empty without a time"),
            number(
                "recorded_completion", "completion time in the recording; live, one tick more: that of the entry", "s"
            ),
            number("entries", "how often the ball came into the target", "1"),
        ),
        _completion,
    ),
    Group(
        (
            number("peaks", "number of velocity peaks (NP) of the ball", "1"),
            number("peaks_whole", "the same with the hold", "1"),
        ),
        _peaks,
    ),
    Group(
        (
            number("cooperative", "time in which the sides moved in opposite directions", "s"),
            number("competitive", "time in which they moved in the same direction", "s"),
            number("single", "time in which one side moved", "s"),
            number("still", "time in which none moved", "s"),
            number("left_only", "of the single movement: the left side's", "s"),
            number("right_only", "of the single movement: the right side's", "s"),
            number("unknown", "time without velocities", "s"),
        ),
        _movements,
    ),
    Group(
        (
            number("braking_distance", "ball to target's midpoint at the onset of the first braking movement", "m"),
            number("braking_velocity", "of the ball towards the target at that onset", "m/s"),
            number("braking_onset", "when that was, from the release on", "s"),
            number("turning_back_distance", "the same distance where turning back at all counts as braking", "m"),
            number("turning_back_velocity", "the same velocity there", "m/s"),
            number("turning_back_onset", "when that was, from the release on", "s"),
            number("initial_onset", "when the initial movement towards the target began", "s"),
            number("wrong_way", "movements of the board before it, in the wrong direction", "1"),
        ),
        _strategy,
    ),
)
"""All groups of measures."""
