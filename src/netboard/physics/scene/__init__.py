"""The simulated scene: parameters, equations of motion, force conditions, energy, closed forms.

Parameters
----------
theta : float
    Tilt of the board, + = right end up [rad].
s, c : float
    Sine and cosine of the tilt [1].
a11, a12, a22 : float
    Inertia against heave, heave with tilt, and tilt [kg, kg m, kg m2].
left_z, left_vz, right_z, right_vz : float
    Heights of the styluses and their rates [m, m/s].
styluses : ndarray of float64, shape (n, 4)
    left_z, left_vz, right_z, right_vz at the times of the states [m, m/s].
config, block : Config, Block
    The whole configuration, and its table ``[block]``.
trial : int
    Number of the trial in the block [1].
rendering : Rendering
    Structure of the rendering; a compile-time constant.
packed : RENDERING record
    Parameters of the commanded forces.
table : ndarray of float64, shape (n,)
    Taylor coefficients of a movement, a row for each series of `netboard.physics.scene.series` [SI].
numbers : tuple
    Numbers of the scene, from `netboard.physics.scene.parameters.numbers_of` [SI].
"""
