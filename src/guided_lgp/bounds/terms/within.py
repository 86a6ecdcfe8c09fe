"""``within(box, support)``: a box ends with all of its footprint in a region of its support.

The region is a rectangle in the frame of the support's top: from its middle, along its sides (m).
"""

import math
from itertools import product

import casadi as ca
import numpy as np

from guided_lgp.bounds.checks import Pose, Top, Vector, axes_of, dot, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.kernels import SCALE, Kernel, in_frame, kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms.term import GoalTerm

_MARGIN = 0.003
"""How far (m) inside the region the program keeps a box."""
_SLACK = 1e-4
"""What rounding may add (m)."""
_CORNERS = tuple(product((-1.0, 1.0), repeat=2))


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    """The corners of the box are inside."""
    x, p = ca.SX.sym("x", 6), ca.SX.sym("p", 6)
    centre, turn = ca.vertcat(*in_frame(x[2], x[3:5] - x[:2])), x[5] - x[2]
    rows = []
    for along, across in _CORNERS:
        corner = centre + ca.vertcat(*in_frame(-turn, ca.vertcat(along * p[4], across * p[5])))
        rows += [corner - p[:2], p[2:4] - corner]
    return (kernel("within", x, p, SCALE * (ca.vertcat(*rows) - _MARGIN)),)


def _add(
    context: Context, box: str, support: str, x0: float, y0: float, x1: float, y1: float
) -> None:
    """Of the box where it is at the end."""
    inputs = (*context.pose[support].plane, *context.pose[box].plane)
    parameters = (x0, y0, x1, y1, *context.half(box)[:2])
    context.rows("within", inputs, parameters, ("within", box, support))


def _draw(
    context: Context,
    generator: np.random.Generator,
    count: int,
    box: str,
    support: str,
    below: Array,
    **region: float,
) -> Array:
    """Along or across the support, wherever that leaves room."""
    half = np.array(context.half(box)[:2])
    quarters = generator.integers(0, 4, count)
    halves = np.where(quarters[:, None] % 2 == 0, half, half[::-1])
    low, high = (np.array([region[f"x{end}"], region[f"y{end}"]]) for end in (0, 1))
    room = np.maximum((high - low) / 2 - halves, 0.0)
    local = (low + high) / 2 + generator.uniform(-1, 1, (count, 2)) * room
    cosine, sine = np.cos(below[2]), np.sin(below[2])
    x = below[0] + cosine * local[:, 0] - sine * local[:, 1]
    y = below[1] + sine * local[:, 0] + cosine * local[:, 1]
    return np.stack([x, y, below[2] + quarters * np.pi / 2], axis=1)


def _check(size: Vector, placement: Pose, top: Top, **region: float) -> float:
    """By how much (m) a corner is outside: negative where all are inside."""
    frame, sides = axes_of(top.pose), axes_of(placement)
    offset = offset_of(top.pose, placement)
    excess = -math.inf
    for signs in _CORNERS:
        corner = [
            o + sum(sign * size[i] / 2 * sides[i][k] for i, sign in enumerate(signs))
            for k, o in enumerate(offset)
        ]
        for axis, name in ((0, "x"), (1, "y")):
            along = dot(corner, frame[axis])
            excess = max(excess, region[f"{name}0"] - along, along - region[f"{name}1"])
    return excess - _SLACK


TERM = GoalTerm(_add, _kernels, draw=_draw, check=_check)
