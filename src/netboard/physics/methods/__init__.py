"""Integrators: one-step explicit, implicit and exponential methods, and the loop that applies them.

Parameters
----------
known : int
    Structure flags of the scene (`known_of`) [1].
k : int
    Number of a table [1].
table : ndarray of float64, shape (n,)
    Taylor coefficients of a movement, a row for each series of `netboard.physics.scene.series` [SI].
numbers : tuple
    Numbers of the scene, from `netboard.physics.scene.parameters.numbers_of` [SI].
lengths, counts : ndarray, shape (n,)
    Length of each interval of a run, and the number of equal steps in it [s, 1].
i : int
    Number of an interval, from 0 [1].
PARTS : Parts
    Structure of the scene.
row : int
    Row of a matrix, or of a table of Taylor coefficients [1].
order : int
    Highest order of a Taylor series [1].
tolerance : float
    Error of a step, relative to the largest speed [1].
side : float
    Sign of the cosine of the tilt during a step [1].
"""
