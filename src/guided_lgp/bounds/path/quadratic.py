"""The quadratic program of one round of :mod:`guided_lgp.bounds.path.optimise`."""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Robot

WAYPOINTS = 10
"""N, between the ends of a motion."""
NEIGHBOURS = 4
"""Pairs of bodies whose distance is constrained at a waypoint."""
_TAU = 0.4
"""Weight of smoothness against length (s): about the time in which a joint reaches full speed."""
_SLACK_WEIGHT, _LEVEL_WEIGHT = 1e4, 1e4
"""Weights of the squared slacks (1/m^2) and tilts, against seconds: 1 mm costs 0.01 s."""


class QuadraticProgram:
    """A program of CasADi that reads and writes arrays: copies took half of its time."""

    def __init__(self, function: Any) -> None:
        """``function`` as ``casadi.qpsol`` returns it."""
        self._numbers = {
            name: np.full(function.numel_in(name), function.default_in(number))
            for number, name in enumerate(function.name_in())
        }
        self._solution = np.empty(function.numel_out("x"))
        self._buffer, self._solve = function.buffer()
        for number, values in enumerate(self._numbers.values()):
            self._buffer.set_arg(number, memoryview(values.data))
        self._buffer.set_res(function.index_out("x"), memoryview(self._solution.data))

    def solve(self, **numbers: Array) -> Array | None:
        """The solution for ``p`` and the bounds ``lbx``, ``ubx``, ``lbg``; None if it fails."""
        for name, values in numbers.items():
            self._numbers[name][:] = values
        self._solve()
        return self._solution.copy() if self._buffer.stats()["success"] else None


@cache
def quadratic_program(robot: Robot, gripper: str) -> QuadraticProgram:
    """The program of one round for an arm, or the mirror image of one, derived by CasADi."""
    arm = robot.arms[gripper]
    n = len(arm.joints)
    q, slack = ca.SX.sym("q", n, WAYPOINTS), ca.SX.sym("slack", WAYPOINTS)
    last = ca.SX.sym("last", n, WAYPOINTS + 2)
    before, after = ca.SX.sym("before", n), ca.SX.sym("after", n)
    gradients = ca.SX.sym("gradients", n, WAYPOINTS * NEIGHBOURS)
    vertical = ca.SX.sym("vertical", 3)
    leaves, enters, level, h = (ca.SX.sym(name) for name in ("leaves", "enters", "level", "h"))
    points = ca.horzcat(last[:, 0], q, last[:, -1])
    weights = ca.diag(ca.SX(1.0 / arm.velocity_limits))
    steps = weights @ (points[:, 1:] - points[:, :-1])
    bends = steps[:, 1:] - steps[:, :-1]
    first = steps[:, 0] - weights @ (last[:, 0] - before)
    final = weights @ (after - last[:, -1]) - steps[:, -1]
    smoothness = ca.sumsqr(bends) + leaves * ca.sumsqr(first) + enters * ca.sumsqr(final)
    cost = ca.sumsqr(steps) / h + _TAU**2 * smoothness / h**3 + _SLACK_WEIGHT * ca.sumsqr(slack)
    angles = ca.SX.sym("angles", n)
    chain = kinematics_of(robot).arms[gripper].chain
    up = chain.pose(angles, 1, (0,) * len(chain.fixed)).rotation[2, :].T
    tilt = ca.Function("tilt", [angles], [up, ca.jacobian(up, angles)])
    for i in range(WAYPOINTS):
        now, change = tilt(last[:, i + 1])
        turned = now + change @ (q[:, i] - last[:, i + 1]) - vertical
        cost += _LEVEL_WEIGHT * level * ca.sumsqr(turned)
    nearest = ca.vertcat(
        *(
            ca.dot(gradients[:, i * NEIGHBOURS + k], q[:, i]) + slack[i]
            for i in range(WAYPOINTS)
            for k in range(NEIGHBOURS)
        )
    )
    numbers = ca.vertcat(
        ca.vec(last),
        before,
        after,
        ca.vec(gradients),
        vertical,
        leaves,
        enters,
        level,
        h,
    )
    problem = {"x": ca.vertcat(ca.vec(q), slack), "f": cost, "g": nearest, "p": numbers}
    return QuadraticProgram(ca.qpsol("motion", "daqp", problem, {"error_on_fail": False}))
