"""The trial state machine, the quality rules for attempts, and repeated trials.

Parameters
----------
rules : RULES record
    The rules of the trial.
trial : int
    Number of the trial in the block, from 1 [1].
present : int
    Number of the current trial [1].
phase : int
    The present `netboard.task.trials.state_machine.Phase` [1].
extra : int
    Trials that operators have added to the block [1].
block_ticks : int
    Duration of the block so far, in ticks [1].
counts : TALLY record
    Counts of an attempt so far; changed in place. ``ended`` is 1 if the last counted tick has ended the attempt.
count : int
    Number of ticks [1].
stylus_range : float
    Heights of the styluses are clipped to +- this [m].
clamped : int
    Bit of the safeguards for a force at its limit [1].
config : Config
    The configuration of the block.
flags : iterable of str
    Flags of an attempt, from `netboard.task.trials.quality.FLAGS`.
outcome : str
    A `netboard.task.trials.state_machine.Outcome`.
"""
