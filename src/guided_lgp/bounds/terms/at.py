"""``at(box, support)``: a box ends at a pose in the world, within a distance and an angle."""

import math

import casadi as ca
import numpy as np

from guided_lgp.bounds.checks import Pose, Top, Vector, axes_of, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.kernels import SCALE, Kernel, distance, kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms.term import GoalTerm

_SHARE = 0.8
"""How much of the tolerances the program uses: a solution is exact to a fraction of a mm."""


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    """Place and yaw are near the wanted ones."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 5)
    way = distance(x[:2] - p[:2])
    turn = distance(ca.vertcat(ca.cos(x[2]) - ca.cos(p[2]), ca.sin(x[2]) - ca.sin(p[2])))
    c = ca.vertcat(SCALE * (p[3] - way), 2 * ca.sin(p[4] / 2) - turn)
    return (kernel("at", x, p, c, lengths=1),)


def _add(
    context: Context,
    box: str,
    support: str,
    x: float,
    y: float,
    z: float,
    yaw: float,
    tolerance: float,
    turn: float,
) -> None:
    """The height follows from the support."""
    place = context.geometry.in_robot(x, y, yaw)
    tolerances = (_SHARE * tolerance, min(_SHARE * turn, math.pi))
    context.rows("at", context.pose[box].plane, (*place, *tolerances), ("at", box, support))


def _draw(
    context: Context,
    generator: np.random.Generator,
    count: int,
    box: str,
    support: str,
    below: Array,
    **numbers: float,
) -> Array:
    return np.tile(
        context.geometry.in_robot(*(numbers[name] for name in ("x", "y", "yaw"))), (count, 1)
    )


def _check(size: Vector, placement: Pose, top: Top, **numbers: float) -> float:
    """By how much (m or rad) the box is not there: negative where it is."""
    goal = tuple(numbers[name] for name in ("x", "y", "z"))
    ahead = axes_of(placement)[0]
    turn = math.remainder(math.atan2(ahead[1], ahead[0]) - numbers["yaw"], math.tau)
    way = math.hypot(*offset_of(goal, placement))
    return max(way - numbers["tolerance"], abs(turn) - numbers["turn"])


TERM = GoalTerm(_add, _kernels, draw=_draw, check=_check)
