"""Measures of movements, forces and success: pure functions of arrays.

A missing sample is NaN. Arguments that differ in length, or lie outside the described range, raise a ValueError.

An argument that means the same in all modules is described here, and in a function only where it differs:

Parameters
----------
rate : float
    Sampling rate [Hz].
values : ndarray, shape (n,)
    Samples of a signal, or one value for each trial in the order of performance [any].
mask : ndarray of bool, shape (n,)
    Whether a condition is true at each sample [1].
seconds : float
    Duration [s].
first, stop : array_like, shape (k,)
    First sample of each run, and the sample after its last [1].
left, right : array_like, shape (n,)
    Velocities of both sides, or another signal of each [any].
relation : Relation
    ``mirrored``: the sides agree when they move in opposite directions, as in a tilt; ``alike``: in the same direction.
left_z, right_z : ndarray, shape (n,)
    Heights of the styluses [m].
left_vz, right_vz : ndarray, shape (n,)
    Vertical velocities of the styluses [m/s].
p : array_like, shape (n,)
    Ball position along the board, + = right [m].
vp : ndarray, shape (n,)
    Velocity of the ball along the board [m/s].
speed : array_like, shape (n,)
    Speed of one movement, from rest to rest, of at least two samples, for jerk three; it lasts n samples [m/s].
theta : array_like, shape (n,)
    Tilt of the board, + = right end up [rad].
target, centre : float
    Centre of the target along the board, + = right [m].
half_width : float
    Half-width of the target, edges included [m].
hold : float
    Minimum uninterrupted duration, as defined by `netboard.analysis.measures.signals.lasting` [s].
trial : Trial
    Position of a trial in these arrays.
segments : Segments
    Movements of the board.
order : ndarray of int64, shape (n,)
    Position of each trial in its condition, from 1, from `netboard.analysis.measures.performance.running_number` [1].
people : ndarray, shape (n,), optional
    Participant or dyad of each trial [1].
points : ndarray, shape (n, 2)
    Distance and velocity of each trial; rows with NaN are ignored [m, m/s].
sources, targets : sequence of array_like, shape (n_k,)
    Trials of both partners, for example the velocities of their styluses [any].
past : Past or None
    Samples of the past to use; None for three of each in steps of 20.
given : sequence of sequence of array_like, shape (n_k,)
    Further signals to condition on, such as the ball's: for each signal, its trials [any].
arm : float
    Distance l from the board's centre to a control point [m].
hand : PassiveHand
    A passive hand, at rest at the first sample.
breaks : sequence of int
    First samples after a jump, such as a repositioning of the ball [1].
unit : str
    Name of the unit that is counted.
"""
