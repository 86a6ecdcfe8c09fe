"""The same programs for IPOPT, an independent solver: the oracle of tests and benchmark."""

from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.coarse.solver import Interpreter, Settings, Solution, equalities
from guided_lgp.bounds.program.arrays import Program
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import kernel_table
from guided_lgp.robots import Robot


class Ipopt:
    """One program in IPOPT (interior point, exact Hessian, CasADi SX).

    With the tolerance and the slack of our solver. Building it takes longer than solving it:
    nothing is shared between programs.
    """

    def __init__(self, robot: Robot, program: Program, values: Array, settings: Settings) -> None:
        """Set up a program; ``values`` gives the constants (variables first, then constants)."""
        self._program = program
        self._settings = settings
        self._interpreter = Interpreter(robot)
        self._table = kernel_table(kinematics_of(robot))
        count = program.variables
        self._constants = values[count:]
        x = ca.SX.sym("x", count)
        everything = ca.vertcat(x, ca.SX(self._constants))
        rows, lower, upper = [], [], []
        for i, number in enumerate(program.kernel):
            kernel = self._table[number]
            input_start, parameter_start, _ = program.starts[:, i]
            inputs = program.inputs[input_start:][: kernel.inputs].tolist()
            parameters = program.parameters[parameter_start:][: kernel.parameters]
            c = kernel.independent(everything[inputs], ca.SX(parameters))
            rows.append(c)
            lower += [0.0 if kernel.equality else -settings.slack] * c.numel()
            upper += [0.0 if kernel.equality else np.inf] * c.numel()
        share = ca.SX.sym("share")
        cost = 0.5 * share * ca.dot(ca.SX(program.weight), (x - ca.SX(program.target)) ** 2)
        options: dict[str, Any] = {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": settings.tolerance,
            "ipopt.constr_viol_tol": settings.tolerance,
            "ipopt.max_iter": settings.steps,
        }
        self._lower, self._upper = lower, upper
        problem = {"x": x, "p": share, "f": cost, "g": ca.vertcat(*rows)}
        self._solver = ca.nlpsol("oracle", "ipopt", problem, options)

    def solve(self, values: Array, optimal: bool = True) -> Solution:
        """Solve from a start.

        Args:
            values: variables first, then constants.
            optimal: go on to a local optimum; otherwise there is no cost and any feasible point
                is one, as for our solver.
        """
        program = self._program
        answer = self._solver(
            x0=values[: program.variables],
            p=float(optimal),
            lbx=program.lower,
            ubx=program.upper,
            lbg=self._lower,
            ubg=self._upper,
        )
        everything = np.concatenate([np.array(answer["x"]).ravel(), self._constants])
        c = self._interpreter.residuals(program, everything)
        equality = equalities(self._table, program)
        worst = float(np.max(np.where(equality, np.abs(c), -c - self._settings.slack), initial=0.0))
        return Solution(everything, c, worst, int(self._solver.stats()["iter_count"]))
