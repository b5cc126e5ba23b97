"""Physics and task composed into one pure tick, and what a participant may see of it.

Open `stage.py`: the samples of both styluses and a command go in; state, forces and events come out. The server runs
it live, `replay --verify` over a recording, `simulate` and rehearsals faster than real time, and all get the same
bits. `styluses.py`, `trial_steps.py` and `perturbing.py` are its parts. `curtain.py` is the only place that makes a
`View`: what a participant sees of a tick, and `blinding.py` keeps from displays and consoles which partner is at a
seat. This wing uses no clock, no socket and no file.

Parameters
----------
s : record of netboard.base.tick.STATE
    State of the stage, updated in place.
rows : ndarray of TICK, shape (n,), or one record of it
    Ticks of a block, in any order.
row : record of netboard.base.tick.TICK
    The tick, updated in place.
words, numbers : ndarray of int64 and of float64, shape (n,)
    The row of a tick as words, and the same memory as numbers [SI].
limit : float
    Largest height of a stylus [m].
hold : int
    Number of the extrapolation in `netboard.stage.styluses.KNOWN_EXTRAPOLATIONS` [1].
scene : record of netboard.physics.scene.parameters.SCENE
    Constants of the scene [SI].
rules : record of netboard.task.trials.state_machine.RULES
    Constants of the task [SI].
config : Config
    The configuration of the rig and of one block.
curtain : Curtain, or record of netboard.stage.curtain.CURTAIN
    What the participants of a block may see, or one of them.
station : str
    ``left`` or ``right``: the seat of the participant who sees the view or display.
number : int
    Number of a tick, from 0 [1].
delay : int
    Delay of the commanded force, in ticks [1].
"""
