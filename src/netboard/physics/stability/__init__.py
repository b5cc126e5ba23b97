"""Largest stable step and delay of a scene, and the method chosen from them.

Parameters
----------
a : ndarray of float64, shape (4, 4)
    Matrix of the board [SI].
loop : Loop
    The coupling's control loop.
balls : int
    Number of balls [1].
solved : ndarray of float64, shape (4, 4), optional
    Matrix that an exponential method solves exactly, if it is another one: that of the level board [SI].
"""
