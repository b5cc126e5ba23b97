"""The paper's measures of an attempt, each by the function of `netboard.analysis` and the reading that are set."""

from netboard.analysis.braking import first_braking
from netboard.analysis.movements import classify, movement_times
from netboard.analysis.peaks import velocity_peaks
from netboard.measuring.tables import Group, count, number
from netboard.measuring.take import RATE, Take


def _completion(take: Take) -> dict[str, float]:
    return {"completion": take.completion, "entries": take.entries}


def _peaks(take: Take) -> dict[str, float]:
    how = take.block.readings.peaks
    counts = {
        name: velocity_peaks(
            take.found.speed[take.trial.window(window)],
            extrema=how.extrema,
            plateau=how.plateau,
            least_prominence=how.least_prominence,
        ).count
        for name, window in (("peaks", how.window), ("peaks_whole", "whole"))
    }
    return dict(counts)


def _movements(take: Take) -> dict[str, float]:
    how = take.block.readings.movements
    window = take.trial.window(how.window)
    classes = classify(
        take.found.left_vz[window], take.found.right_vz[window], still_below=how.still_below, at_limit=how.at_limit
    )
    times = movement_times(classes, RATE)
    return {name: getattr(times, name) for name in times.__slots__}


def _strategy(take: Take) -> dict[str, float]:
    how = take.block.readings.strategy
    values: dict[str, float] = {}
    for prefix, braking in (("braking", how.braking), ("turning_back", "rotation")):
        found = first_braking(
            take.turns, take.found.theta, take.found.p, take.found.vp, RATE, take.trial, braking=braking
        )
        distance = found.distance if how.distance == "signed" else found.absolute_distance
        values |= {f"{prefix}_distance": distance, f"{prefix}_velocity": found.velocity, f"{prefix}_onset": found.onset}
        values |= {"initial_onset": found.initial, "wrong_way": found.wrong_way}
    return values


PAPER = (
    Group(
        (
            number("completion", "completion time: from the release to the beginning of the hold", "s"),
            count("entries", "how often the ball came into the target"),
        ),
        _completion,
    ),
    Group(
        (
            count("peaks", "number of velocity peaks (NP) of the ball"),
            count("peaks_whole", "the same with the hold"),
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
            count("wrong_way", "movements of the board before it, in the wrong direction"),
        ),
        _strategy,
    ),
)
"""All of them."""
