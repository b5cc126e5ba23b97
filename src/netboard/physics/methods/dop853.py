"""The method of order 8 of Dormand and Prince with 12 stages, at a fixed step.

Coefficients of DOP853 by Hairer and Wanner (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
II.5), the nearest numbers of float64; those that are zero are left out, with their products.
"""

import numpy as np

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.vectors import State, blend, plus
from netboard.physics.hands.extrapolation import drives
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import Parts

NODES = (
    0.0,
    0.05260015195876773,
    0.0789002279381516,
    0.1183503419072274,
    0.2816496580927726,
    0.3333333333333333,
    0.25,
    0.3076923076923077,
    0.6512820512820513,
    0.6,
    0.8571428571428571,
    1.0,
)
"""Nodes of its stages, in step lengths [1]."""

_A3 = (
    0.0197250569845379,  # k1
    0.0591751709536137,  # k2
)
_A4 = (
    0.02958758547680685,  # k1
    0.08876275643042054,  # k3
)
_A5 = (
    0.2413651341592667,  # k1
    -0.8845494793282861,  # k3
    0.924834003261792,  # k4
)
_A6 = (
    0.037037037037037035,  # k1
    0.17082860872947386,  # k4
    0.12546768756682242,  # k5
)
_A7 = (
    0.037109375,  # k1
    0.17025221101954405,  # k4
    0.06021653898045596,  # k5
    -0.017578125,  # k6
)
_A8 = (
    0.03709200011850479,  # k1
    0.17038392571223998,  # k4
    0.10726203044637328,  # k5
    -0.015319437748624402,  # k6
    0.008273789163814023,  # k7
)
_A9 = (
    0.6241109587160757,  # k1
    -3.3608926294469414,  # k4
    -0.868219346841726,  # k5
    27.59209969944671,  # k6
    20.154067550477894,  # k7
    -43.48988418106996,  # k8
)
_A10 = (
    0.47766253643826434,  # k1
    -2.4881146199716677,  # k4
    -0.590290826836843,  # k5
    21.230051448181193,  # k6
    15.279233632882423,  # k7
    -33.28821096898486,  # k8
    -0.020331201708508627,  # k9
)
_A11 = (
    -0.9371424300859873,  # k1
    5.186372428844064,  # k4
    1.0914373489967295,  # k5
    -8.149787010746927,  # k6
    -18.52006565999696,  # k7
    22.739487099350505,  # k8
    2.4936055526796523,  # k9
    -3.0467644718982196,  # k10
)
_A12 = (
    2.273310147516538,  # k1
    -10.53449546673725,  # k4
    -2.0008720582248625,  # k5
    -17.9589318631188,  # k6
    27.94888452941996,  # k7
    -2.8589982771350235,  # k8
    -8.87285693353063,  # k9
    12.360567175794303,  # k10
    0.6433927460157636,  # k11
)
_B = (
    0.054293734116568765,  # k1
    4.450312892752409,  # k6
    1.8915178993145003,  # k7
    -5.801203960010585,  # k8
    0.3111643669578199,  # k9
    -0.1521609496625161,  # k10
    0.20136540080403034,  # k11
    0.04471061572777259,  # k12
)


@inlined
def dop853(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of DOP853 without its control of the step (order 8)."""
    left, right = drives(hands, 0, 0.0)
    k1 = rates(x, left, right, parts, scene)
    left, right = drives(hands, 1, NODES[1] * h)
    k2 = rates(plus(x, NODES[1] * h, k1), left, right, parts, scene)
    left, right = drives(hands, 2, NODES[2] * h)
    k3 = rates(blend(x, h, _A3, (k1, k2)), left, right, parts, scene)
    left, right = drives(hands, 3, NODES[3] * h)
    k4 = rates(blend(x, h, _A4, (k1, k3)), left, right, parts, scene)
    left, right = drives(hands, 4, NODES[4] * h)
    k5 = rates(blend(x, h, _A5, (k1, k3, k4)), left, right, parts, scene)
    left, right = drives(hands, 5, NODES[5] * h)
    k6 = rates(blend(x, h, _A6, (k1, k4, k5)), left, right, parts, scene)
    left, right = drives(hands, 6, NODES[6] * h)
    k7 = rates(blend(x, h, _A7, (k1, k4, k5, k6)), left, right, parts, scene)
    left, right = drives(hands, 7, NODES[7] * h)
    k8 = rates(blend(x, h, _A8, (k1, k4, k5, k6, k7)), left, right, parts, scene)
    left, right = drives(hands, 8, NODES[8] * h)
    k9 = rates(blend(x, h, _A9, (k1, k4, k5, k6, k7, k8)), left, right, parts, scene)
    left, right = drives(hands, 9, NODES[9] * h)
    k10 = rates(blend(x, h, _A10, (k1, k4, k5, k6, k7, k8, k9)), left, right, parts, scene)
    left, right = drives(hands, 10, NODES[10] * h)
    k11 = rates(blend(x, h, _A11, (k1, k4, k5, k6, k7, k8, k9, k10)), left, right, parts, scene)
    left, right = drives(hands, 11, NODES[11] * h)
    k12 = rates(blend(x, h, _A12, (k1, k4, k5, k6, k7, k8, k9, k10, k11)), left, right, parts, scene)
    return blend(x, h, _B, (k1, k6, k7, k8, k9, k10, k11, k12))
