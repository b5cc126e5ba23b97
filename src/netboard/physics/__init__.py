"""The scene: board, ball and the virtual coupling to both styluses. Pure: states in, states out.

Open `scene/models.py` first: the paper's equations and the full Lagrangian. `hands` extrapolates the styluses between
samples, `methods` has the integrators, `stability` the theory that chooses one for a scene, and `simulation` moves a
scene by recorded hands, offline. From outside, import `simulation`, `scene.parameters` and `stability.method_choice`;
the live server reaches all of it through `netboard.stage`. This wing uses no trials, no clock and no files.

Arguments that mean the same in all rooms are described here, and in a function only where they differ:

Parameters
----------
x : tuple of float
    The state [SI].
h : float
    Step size [s].
parts : Parts
    Structure of the scene; in kernels a compile-time constant.
scene : SCENE record, or ndarray of SCENE, shape (1,)
    The scene.
physics : Physics
    The scene as the configuration's table.
length : int
    Length of the scene's state vector: four for the board and two for each ball [1].
states : ndarray of float64, shape (n, length)
    States [SI].
free : bool
    The balls can move; otherwise they are fixed.
left, right : float
    Drives of the hands [N].
hands : tuple
    Drives of both hands during the step, for `netboard.physics.hands.extrapolation.drives` [N].
method : str
    Name of the integration method.
tables : tuple of ndarray of float64, shape (kinds, k, n, n), and int
    Tables from `Method.tables` for each step size, and the index of the current one; unused by methods without tables.
motion : Motion
    Result of a simulation.
"""
