"""Policies that hold a stylus in place of a person, the simulated device in their hand, and the closed loop. Pure.

Open `people/controller.py` first: the simulated participant, an intermittent, predictive, delayed PD controller.
`body` has the mechanics of haptic devices, and `seat` the closed loop of a block. This wing knows no device driver, no
network and no clock.

Parameters
----------
person, participant : Participant
    Parameters of the participant.
physics, task : Physics, Task
    Constants of the scene and rules of the task, which the participant knows.
sides : tuple of Side
    Hands of the participant: one in a dyad, both in a bimanual block.
rng : numpy.random.Generator
    Source of the participant's variability: of its decisions, or of a hand's force noise and lateral rest position.
state, k : record of STATE, record of CONSTANTS
    State of a controller, changed in place, and its constants.
intent : record of INTENT
    A submovement of one's own that is under way, with what is expected of the partner.
side : int
    An own hand: 0 left, 1 right [1].
when : float
    A time, later than the glimpse perceived, or infinity [s].
now : float
    Present time, later than in the previous call [s].
glimpse : Glimpse or None, or record of SEEN
    Newest glimpse of the participant's own display; before the first None, or a record whose time is NaN.
felt : float or None
    Vertical force on the participant's hand, + = up; None or NaN without haptic feedback, and with two hands [N].
force : float
    Force on one's own hand, + = up [N].
phase : float
    Number of a `netboard.task.trials.state_machine.Phase` [1].
dt : float
    Elapsed time [s].
senses : record of SENSES
    Memory of what was seen and felt; only `senses.store` changes it.
o, c : record of OBSERVED, record of OBSERVER
    State of an observer of the partner, changed in place, and its constants.
model : DyadModel
    The dyad as the observer takes it to be.
haptic : bool
    Whether the filter takes the force in.
device, virtual : VirtualDevice
    The table ``[virtual]`` of the configuration.
s, arm : record of MUSCLES, record of ARM
    State of an arm, changed in place, and its constants.
tip, cables : record of TIP, record or ndarray of CABLES
    State of the stylus side of compliant cables, changed in place, and their constants; no row for rigid cables.
action : record of ACTION
    What a hand does to the stylus until the next update.
fx, fy, fz : float
    Motor force on the stylus [N].
steps : int
    Number of steps of length `stylus.STEP` [1].
"""
