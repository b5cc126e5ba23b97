"""The scene: board, ball and the virtual coupling to both styluses. Pure: states in, states out.

Open `scene/models.py` first: the paper's equations and the full Lagrangian. `hands` extrapolates the styluses between
samples, `methods` has the integrators, `stability` the theory that chooses one for a scene, and `simulation` moves a
scene by recorded hands, offline. From outside, import `simulation`, `scene.parameters` and `stability.method_choice`;
the live server reaches all of it through `netboard.stage`. This wing uses no trials, no clock and no files.
"""
