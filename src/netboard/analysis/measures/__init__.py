"""Measures of movements, forces and success: pure functions of arrays.

An argument that means the same in all modules is described here:

Parameters
----------
rate : float
    Sampling rate [Hz].
p : array_like, shape (n,)
    Ball position along the board, + = right [m].
theta : array_like, shape (n,)
    Tilt of the board, + = right end up [rad].
order : ndarray of int64, shape (n,)
    Position of each trial in its condition, from 1, from `netboard.analysis.measures.performance.running_number`
    [1].
segments : Segments
    Movements of the board.
half_width : float
    Half-width of the target [m].
arm : float
    Distance l from the board's centre to a control point [m].
hand : PassiveHand
    A passive hand, at rest at the first sample.
breaks : sequence of int
    First samples after a jump [1].
"""
