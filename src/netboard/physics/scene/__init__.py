"""The simulated scene: parameters, equations of motion, force conditions, energy, closed forms.

Parameters
----------
felt : Rendering
    Structure of the rendering; a compile-time constant.
"""
