"""The trial state machine, the quality rules for attempts, and repeated trials.

Parameters
----------
rules : RULES record
    The rules of the trial.
trial : int
    Number of the trial in the block, from 1 [1].
present : int
    Number of the current trial [1].
"""
