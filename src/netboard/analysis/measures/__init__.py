"""Measures of movements, forces and success: pure functions of arrays.

An argument that means the same in all modules is described here:

Parameters
----------
rate : float
    Sampling rate [Hz].
"""
