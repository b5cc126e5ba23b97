"""Where a stylus is at the tick, from its last sample.

Samples arrive between ticks. Extrapolating them by their velocity makes the error of a 1 kHz input some ten times
smaller than holding them does, and bounding the reach of it keeps a late sample from flinging the stylus away.
"""

from netboard.compiled import kernel


@kernel
def constant_velocity(z: float, vz: float, age: float, reach: float) -> float:
    """Return the height at the tick of a stylus that keeps its velocity.

    Parameters
    ----------
    z : float
        Height as sampled [m].
    vz : float
        Its rate as sampled [m/s].
    age : float
        Time from the sample to the tick; negative if the sample is of later [s].
    reach : float
        The age counts as at most this, in either direction [s].

    Returns
    -------
    float
        Height at the tick [m].
    """
    bounded = age
    if age > reach:
        bounded = reach
    elif age < -reach:
        bounded = -reach
    return z + vz * bounded
