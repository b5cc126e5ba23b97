"""Drake (https://drake.mit.edu): its simulator with error control, on the equations as a symbolic system.

A symbolic system is evaluated in C++, three times as fast as one written in Python. Drake's simulator returns states
only where it stops, so errors are measured at fewer points, 10 ms apart, and steps end there.
"""

from functools import partial
from typing import Any

import numpy as np

from evidence.physics.reference import derivatives, push_and_turn
from evidence.physics.work_precision import Solution, Solver
from netboard.benchmarks.physics.problem import STATE_NAMES, Problem

LIBRARY = "Drake"
SCHEMES = {
    "bogacki_shampine3": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
    "runge_kutta3": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
    "runge_kutta5": (1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "radau3": (1e-2, 1e-3, 1e-5),
}
COARSE = {"runge_kutta5": (1e-3, 1e-7)}

STRIDE = 5
"""Errors are measured at every fifth point of the problem [1]."""

_LONGEST = 0.1
"""Longest step [s]."""


def solvers(problem: Problem, coarse: bool) -> list[Solver]:
    """Return the solvers under comparison."""
    chosen = COARSE if coarse else SCHEMES
    return [_solver(problem, scheme, accuracy) for scheme, all_of in chosen.items() for accuracy in all_of]


class Run:
    """A simulator of the problem.

    - `accuracy`: target of its error control, in Drake's measure [1].
    """

    def __init__(self, problem: Problem, scheme: str, accuracy: float, hands: bool = True) -> None:
        from pydrake.all import ResetIntegratorFromFlags, Simulator, SymbolicVectorSystem, Variable, cos, sin

        self._problem = problem
        t, x = Variable("t"), [Variable(name) for name in STATE_NAMES]
        push, turn = push_and_turn(problem.waves.tolist(), t, sin) if hands else (0.0, 0.0)
        rates = derivatives(problem.physics, x, push, turn, sin, cos)
        system = SymbolicVectorSystem(time=t, state=np.array(x), dynamics=np.array(rates))
        self._simulator = Simulator(system)
        ResetIntegratorFromFlags(self._simulator, scheme, _LONGEST)
        self._integrator = self._simulator.get_mutable_integrator()
        self._integrator.set_fixed_step_mode(False)
        self._integrator.set_target_accuracy(accuracy)

    def _rewind(self, state: tuple[float, ...]) -> Any:
        """Reset the simulator to the initial state, and return its context."""
        context = self._simulator.get_mutable_context()
        context.SetTime(0.0)
        context.SetContinuousState(state)
        self._simulator.Initialize()
        self._integrator.ResetStatistics()
        return context

    def bare(self) -> None:
        """Run without stops."""
        self._rewind(self._problem.first)
        self._simulator.AdvanceTo(self._problem.duration)

    def solve(self) -> Solution:
        """Run without stops to count steps, and with stops for the states."""
        self.bare()
        steps, calls = self._integrator.get_num_steps_taken(), self._integrator.get_num_derivative_evaluations()
        context = self._rewind(self._problem.first)
        states = [self._problem.first]
        for time in self._problem.times[STRIDE::STRIDE]:
            self._simulator.AdvanceTo(time)
            states.append(context.get_continuous_state_vector().CopyToVector())
        return Solution(np.array(states), STRIDE, steps, calls)

    def evenly(self, steps: int) -> None:
        """Run in a number of equal steps."""
        self._integrator.set_fixed_step_mode(True)
        self._integrator.set_maximum_step_size(self._problem.duration / steps)
        self._rewind((0.0, 0.0, 0.0, 0.0, 1e-3, 0.0))
        self._simulator.AdvanceTo(self._problem.duration)


def _solver(problem: Problem, scheme: str, accuracy: float) -> Solver:
    """Return a solver; its simulators are built when it first runs."""
    made: dict[str, Any] = {}

    def solve() -> Solution:
        made["run"] = Run(problem, scheme, accuracy)
        solution: Solution = made["run"].solve()
        made["alone"] = partial(Run(problem, scheme, accuracy, hands=False).evenly, solution.steps)
        return solution

    def bare() -> None:
        made["run"].bare()

    def alone() -> object:
        return made["alone"]()

    return Solver(LIBRARY, scheme, f"accuracy {accuracy:.0e}", solve, bare, inputs=True, alone=alone)
