"""Measures of an attempt, computed by `analysis.measures` as the settings say: the paper's, and those beyond it.

The modern measures are lags, smoothness, reactions, time in target and forces. Their window always ends at the
completion. Forces are those of the hands on the board, filtered like all data; static support is subtracted where the
two hands are compared.
"""

from math import nan

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.tables import Group, number, words
from netboard.analysis.extraction.trials import RATE, AttemptData
from netboard.analysis.measures.braking import Braking, Strategy, first_braking
from netboard.analysis.measures.interaction import effort, exchanged, force_share, interaction, supports, work
from netboard.analysis.measures.lags import lag_of
from netboard.analysis.measures.motion import Window
from netboard.analysis.measures.movements import classify, movement_times
from netboard.analysis.measures.peaks import Peaks, velocity_peaks
from netboard.analysis.measures.smoothness import log_dimensionless_jerk, spectral_arc_length
from netboard.analysis.measures.task import overshoots, reaction, time_in_target
from netboard.base.config import SIDES


def peaks_of(take: AttemptData, window: Window) -> Peaks:
    """Find the velocity peaks of the ball, as the settings say."""
    how = take.block.readings.peaks
    return velocity_peaks(
        take.motion.speed[take.trial.window(window)],
        extrema=how.extrema,
        plateau=how.plateau,
        least_prominence=how.least_prominence,
        least_share=how.least_share,
    )


def classes_of(take: AttemptData) -> NDArray[np.int8]:
    """Classify the movement of the styluses at each sample of the set window."""
    how = take.block.readings.movements
    window = take.trial.window(how.window)
    left, right = take.motion.left_vz[window], take.motion.right_vz[window]
    return classify(left, right, still_below=how.still_below, at_limit=how.at_limit)


def strategy_of(take: AttemptData, braking: Braking) -> Strategy:
    """Find the first braking movement."""
    found = take.motion
    return first_braking(take.own_segments, found.theta, found.p, found.vp, RATE, take.trial, braking=braking)


def _completion(take: AttemptData) -> dict[str, float | str]:
    return {
        "completion": take.completion,
        "completion_source": take.source,
        "recorded_completion": take.attempt.completion,
        "entries": take.entries,
    }


def _peaks(take: AttemptData) -> dict[str, float]:
    window = take.block.readings.peaks.window
    return {
        "peaks": peaks_of(take, window).count if take.knows(window) else nan,
        "peaks_whole": peaks_of(take, "whole").count,
    }


def _movements(take: AttemptData) -> dict[str, float]:
    known = take.knows(take.block.readings.movements.window)
    times = movement_times(classes_of(take), RATE)
    return {name: getattr(times, name) if known else nan for name in times.__slots__}


def _strategy(take: AttemptData) -> dict[str, float]:
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
            words(
                "completion_source",
                "where completion comes from: samples, or recording if the samples show no hold; empty without a time",
            ),
            number(
                "recorded_completion",
                "completion time in the recording; live, it is one tick longer, as it includes the tick of the entry",
                "s",
            ),
            number("entries", "number of entries of the ball into the target", "1"),
        ),
        _completion,
    ),
    Group(
        (
            number("peaks", "number of velocity peaks (NP) of the ball", "1"),
            number("peaks_whole", "number of velocity peaks (NP), including the hold", "1"),
        ),
        _peaks,
    ),
    Group(
        (
            number("cooperative", "time in which the sides moved in opposite directions", "s"),
            number("competitive", "time in which the sides moved in the same direction", "s"),
            number("single", "time in which only one side moved", "s"),
            number("still", "time in which neither side moved", "s"),
            number("left_only", "time of single movement in which the left side moved", "s"),
            number("right_only", "time of single movement in which the right side moved", "s"),
            number("unknown", "time without velocities", "s"),
        ),
        _movements,
        of_hands=True,
    ),
    Group(
        (
            number("braking_distance", "ball to target's midpoint at the onset of the first braking movement", "m"),
            number(
                "braking_velocity",
                "velocity of the ball towards the target at the onset of the first braking movement",
                "m/s",
            ),
            number("braking_onset", "onset of the first braking movement, from the release", "s"),
            number(
                "turning_back_distance", "distance to the target's midpoint at the first reversal of the board", "m"
            ),
            number(
                "turning_back_velocity",
                "velocity of the ball towards the target at the first reversal of the board",
                "m/s",
            ),
            number("turning_back_onset", "first reversal of the board, from the release", "s"),
            number("initial_onset", "onset of the initial movement towards the target, from the release", "s"),
            number(
                "wrong_way", "number of movements of the board in the wrong direction before the initial movement", "1"
            ),
        ),
        _strategy,
    ),
)
"""The measures of the paper, by groups."""


MAX_LAG = 0.5
"""Largest delay in the cross-correlation [s]."""

_LEAST = 3
"""Minimum number of samples for smoothness measures [1]."""


def _lag(take: AttemptData) -> dict[str, float]:
    window = take.trial.window()
    left, right = take.motion.left_vz[window], take.motion.right_vz[window]
    if left.size < 2 * MAX_LAG * RATE:
        return {}
    found = lag_of(left, right, RATE, longest=MAX_LAG)
    return {"lag": found.delay, "lag_correlation": found.coefficient, "correlation": found.at_once}


def _smoothness(take: AttemptData) -> dict[str, float]:
    speed = take.motion.speed[take.trial.window()]
    if speed.size < _LEAST:
        return {}
    return {"sparc": spectral_arc_length(speed, RATE), "ldlj": log_dimensionless_jerk(speed, RATE)}


def _reactions(take: AttemptData) -> dict[str, float]:
    values: dict[str, float] = {}
    for side in SIDES:
        found = reaction(getattr(take.motion, f"{side}_vz")[take.trial.window()], RATE)
        values |= {f"{side}_reaction": found.time, f"{side}_anticipated": found.anticipated}
    return values


def _stays(take: AttemptData) -> dict[str, float]:
    p, sizes = take.raw("p")[take.trial.window()], take.block.config.geometry
    if not p.size:
        return {}
    half = sizes.target_width / 2
    stays = time_in_target(p, RATE, centre=take.trial.target, half_width=half)
    beyond = overshoots(p, RATE, centre=take.trial.target, half_width=half)
    return {"in_target": stays.time, "overshoots": beyond.count, "overshoot": beyond.largest}


def _forces(take: AttemptData) -> dict[str, float]:
    window, scene = take.trial.window(), take.block.config.physics
    force = {side: take.force(side, window) for side in SIDES}
    power = {side: force[side] * getattr(take.motion, f"{side}_vz")[window] for side in SIDES}
    duration = (window.stop - window.start) / RATE
    values: dict[str, float] = {}
    for side in SIDES:
        done = work(force[side], getattr(take.motion, f"{side}_vz")[window], RATE)
        values |= {f"{side}_given": done.given, f"{side}_received": done.received}
        values |= {
            f"{side}_effort": effort(force[side], RATE),
            f"{side}_power": done.net / duration if duration else np.nan,
        }
    to_right, to_left = exchanged(power["left"], power["right"], RATE)
    borne = supports(take.motion.p[window], board_mass=scene.M, ball_mass=scene.m, arm=scene.l, g=scene.g)
    left, right = (force[side] - bears for side, bears in zip(SIDES, borne, strict=True))
    between = np.abs(interaction(left, right).between)
    return values | {
        "to_right": to_right,
        "to_left": to_left,
        "interaction": float(between.mean()) if between.size else np.nan,
        "force_share": force_share(left, right),
    }


MODERN = (
    Group(
        (
            number("lag", "delay of the sides by cross-correlation of their velocities, + = right first", "s"),
            number("lag_correlation", "correlation of the mirrored velocities at that delay", "1"),
            number("correlation", "correlation without a delay", "1"),
        ),
        _lag,
        of_hands=True,
    ),
    Group(
        (
            number("sparc", "spectral arc length of the ball's speed", "1"),
            number("ldlj", "log dimensionless jerk of the ball's speed", "1"),
        ),
        _smoothness,
    ),
    Group(
        tuple(
            field
            for side in SIDES
            for field in (
                number(f"{side}_reaction", f"onset of the {side} stylus' movement, from the release", "s"),
                number(
                    f"{side}_anticipated",
                    f"1: anticipation; the {side} stylus moved before any possible reaction to the release",
                    "1",
                ),
            )
        ),
        _reactions,
        of_hands=True,
    ),
    Group(
        (
            number("in_target", "time of the ball in the target before the hold", "s"),
            number("overshoots", "number of times the ball passed the target", "1"),
            number("overshoot", "largest distance by which the ball passed the target", "m"),
        ),
        _stays,
    ),
    Group(
        (
            *(
                field
                for side in SIDES
                for field in (
                    number(f"{side}_given", f"positive work of the {side} hand on the virtual coupling", "J"),
                    number(f"{side}_received", f"positive work of the virtual coupling on the {side} hand", "J"),
                    number(f"{side}_effort", f"integral of the squared force of the {side} hand", "N2 s"),
                    number(f"{side}_power", f"mean power of the {side} hand", "W"),
                )
            ),
            number("to_right", "energy transferred from the left hand to the right hand", "J"),
            number("to_left", "energy transferred from the right hand to the left hand", "J"),
            number("interaction", "mean magnitude of the forces that cancel in the tilt", "N"),
            number("force_share", "share of the right hand in the forces of both, without static support", "1"),
        ),
        _forces,
        of_hands=True,
    ),
)
"""The measures beyond the paper, by groups."""
