"""The stage kernels: residuals of the coarse NLP's constraints, with their Jacobians.

A kernel is the symbolic form of one kind of constraint. Any skeleton's NLP is then a list of
instances: a kernel, where in the vector of values its arguments stand, and its parameters. Nothing
is built per skeleton, so that the kernels can be compiled once.

Poses of boxes are level, ``(x, y, yaw, z)`` in the robot's frame (m, rad), ``z`` the height of the
centre before an offset. All residuals are multiplied by ``SCALE`` where they are lengths, so that
one tolerance serves all. Equalities are ``c = 0``, inequalities ``c >= 0``.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.coarse.kinematics import COARSE_SPHERES, SPHERES, arm_pose, inverse
from guided_lgp.scene import pr2

SCALE = 5.0
"""Weight of a residual in m against one in rad."""

STACK = 8
"""Most boxes in one sum of weights."""

PALM_GAP = 0.002
"""Distance of the box's nearest corner from the palm (m)."""

PAD_CENTRE = -0.02
"""x of the centre of the fingertips' pads in the tool frame (m)."""

RADII = np.array([sphere.radius for sphere in SPHERES])
"""Radii (m) of the spheres."""


@dataclass(frozen=True)
class Kernel:
    """One kind of constraint.

    ``residual`` and ``jacobian`` are CasADi functions of (x, p): arguments (inputs,) and
    parameters (parameters,) to c (rows,) and to c and its dense Jacobian (rows, inputs).
    """

    name: str
    equality: bool
    inputs: int
    parameters: int
    rows: int
    lengths: int
    """How many rows, the first ones, are lengths; the others are in rad."""
    residual: Any
    jacobian: Any
    independent: Any
    """Like ``residual``, with no more rows than independent constraints, for other solvers."""


def _kernel(
    name: str,
    equality: bool,
    x: Any,
    p: Any,
    c: Any,
    lengths: int | None = None,
    independent: Any = None,
) -> Kernel:
    jacobian = ca.densify(ca.jacobian(c, x))
    return Kernel(
        name=name,
        equality=equality,
        inputs=x.numel(),
        parameters=p.numel(),
        rows=c.numel(),
        lengths=c.numel() if lengths is None else lengths,
        residual=ca.Function(f"{name}_residual", [x, p], [ca.densify(c)]),
        # transposed: CasADi stores columns, the solver reads rows
        jacobian=ca.Function(f"{name}_jacobian", [x, p], [ca.densify(c), jacobian.T]),
        independent=ca.Function(
            f"{name}_independent", [x, p], [c if independent is None else independent]
        ),
    )


def _absolute(value: Any) -> Any:
    """Absolute value, smooth at zero."""
    return ca.sqrt(value**2 + 1e-8)


def tool_target(pose: Any, height: Any, pitch: Any, offset: Any, p: Any) -> tuple[Any, Any]:
    """Where the tool must be to hold a level box.

    The fingers close across the box's width; the approach axis lies in the vertical plane along
    its length, ``pitch`` below the horizontal (pi/2: from above; beyond: from the other end). The
    palm touches the box's nearest corner, ``offset`` moves the tool along its own z axis.

    Args:
        pose: (x, y, yaw) of the box.
        height: z of its centre (m).
        pitch: of the approach (rad), in [0, pi].
        offset: along the tool's z axis (m).
        p: (half length, half height, turn of the length against the box's x axis, distance back
            along the approach).

    Returns:
        position (3,) and rotation (3, 3) of the tool.
    """
    half_length, half_height, turn, back = (p[i] for i in range(4))
    heading = pose[2] + turn
    ch, sh, cp, sp = ca.cos(heading), ca.sin(heading), ca.cos(pitch), ca.sin(pitch)
    x_axis = ca.vertcat(ch * cp, sh * cp, -sp)
    y_axis = ca.vertcat(-sh, ch, 0)
    z_axis = ca.vertcat(ch * sp, sh * sp, cp)
    reach = half_length * _absolute(cp) + half_height * sp + pr2.PALM_FRONT + PALM_GAP
    centre = ca.vertcat(pose[0], pose[1], height)
    return centre - (reach + back) * x_axis - offset * z_axis, ca.horzcat(x_axis, y_axis, z_axis)


def _hold() -> Kernel:
    """The gripper is at the box: tool frame of the arm = target of the grasp.

    The orientation is written as the whole y axis and the whole direction of gravity, which vanish
    together at the target only.
    """
    x, p = ca.SX.sym("x", 13), ca.SX.sym("p", 8)
    q, pitch, offset, pose, z = x[:7], x[7], x[8], x[9:12], x[12]
    side, torso, z_offset, up = p[0], p[1], p[2], p[3]
    arm = arm_pose(q, side, torso)
    position, rotation = tool_target(pose, z + z_offset + up, pitch, offset, p[4:8])
    c = ca.vertcat(
        SCALE * (arm.position - position),
        arm.rotation[:, 1] - rotation[:, 1],
        arm.rotation[2, 0] - rotation[2, 0],
        arm.rotation[2, 2] - rotation[2, 2],
    )
    twist = ca.mtimes(rotation.T, arm.rotation)
    # Rodrigues' vector of the rotation between the two: axis times tan(angle / 2)
    rodrigues = ca.vertcat(
        twist[2, 1] - twist[1, 2], twist[0, 2] - twist[2, 0], twist[1, 0] - twist[0, 1]
    ) / (1 + ca.trace(twist))
    return _kernel("hold", True, x, p, c, 3, ca.vertcat(c[:3], rodrigues))


def _pads() -> Kernel:
    """Tips and pads of the fingers are on the side of the box that they close on."""
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 4)
    pitch, offset = x[0], x[1]
    pose = ca.SX.zeros(3)
    target, rotation = tool_target(pose, 0, pitch, offset, ca.vertcat(p[0], p[1], 0, 0))
    pad = target + PAD_CENTRE * rotation[:, 0]
    c = ca.vertcat(
        *(
            limit - sign * point[axis]
            for point in (target, pad)
            for sign in (1, -1)
            for axis, limit in ((0, p[2]), (2, p[3]))
        )
    )
    return _kernel("pads", False, x, p, SCALE * c)


def _clear() -> Kernel:
    """The spheres of an arm keep their distance from a level box or table."""
    x, p = ca.SX.sym("x", 11), ca.SX.sym("p", 7 + len(SPHERES))
    q, pose, z = x[:7], x[7:10], x[10]
    side, torso, z_offset, half, margin = p[0], p[1], p[2], p[3:6], p[6]
    arm = arm_pose(q, side, torso)
    cosine, sine = ca.cos(pose[2]), ca.sin(pose[2])
    rows = []
    for i in range(len(SPHERES)):
        d = arm.spheres[:, i] - ca.vertcat(pose[0], pose[1], z + z_offset)
        local = ca.vertcat(cosine * d[0] + sine * d[1], -sine * d[0] + cosine * d[1], d[2])
        outside = ca.fabs(local) - half
        reach = ca.sqrt(ca.sumsqr(ca.fmax(outside, 0)) + 1e-12)
        inside = ca.fmin(ca.fmax(ca.fmax(outside[0], outside[1]), outside[2]), 0)
        rows.append(SCALE * (reach + inside - p[7 + i] - margin))
    return _kernel("clear", False, x, p, ca.vertcat(*rows))


def _apart() -> Kernel:
    """Spheres of the two arms keep their distance."""
    radii = len(SPHERES)
    x, p = ca.SX.sym("x", 14), ca.SX.sym("p", 4 + radii)
    first, second = arm_pose(x[:7], p[0], p[2]), arm_pose(x[7:], p[1], p[2])
    rows = [
        ca.sqrt(ca.sumsqr(first.spheres[:, i] - second.spheres[:, j]) + 1e-12)
        - p[4 + i]
        - p[4 + j]
        - p[3]
        for i in COARSE_SPHERES
        for j in COARSE_SPHERES
    ]
    return _kernel("apart", False, x, p, SCALE * ca.vertcat(*rows))


def _beside() -> Kernel:
    """Two level boxes do not overlap, seen from above: a line at an angle separates them."""
    x, p = ca.SX.sym("x", 7), ca.SX.sym("p", 5)
    first, second, angle = x[:3], x[3:6], x[6]
    normal = ca.vertcat(ca.cos(angle), ca.sin(angle))
    extent: Any = 0
    for pose, half in ((first, p[:2]), (second, p[2:4])):
        cosine, sine = ca.cos(pose[2]), ca.sin(pose[2])
        extent += half[0] * _absolute(normal[0] * cosine + normal[1] * sine)
        extent += half[1] * _absolute(-normal[0] * sine + normal[1] * cosine)
    distance = ca.dot(normal, second[:2] - first[:2])
    return _kernel("beside", False, x, p, SCALE * (distance - extent - p[4]))


def _inside() -> Kernel:
    """The centre of mass of up to ``STACK`` boxes is inside the top of their support."""
    x, p = ca.SX.sym("x", 3 + 2 * STACK), ca.SX.sym("p", 2 + STACK)
    points = ca.reshape(x[3:], 2, STACK)
    d = ca.mtimes(points, p[2:]) - x[:2]
    cosine, sine = ca.cos(x[2]), ca.sin(x[2])
    along, across = cosine * d[0] + sine * d[1], -sine * d[0] + cosine * d[1]
    c = ca.vertcat(p[0] - along, p[0] + along, p[1] - across, p[1] + across)
    return _kernel("inside", False, x, p, SCALE * c)


def _carried() -> Kernel:
    """A box keeps its place on the box that carries it: relative poses before and after agree."""
    x, p = ca.SX.sym("x", 12), ca.SX.sym("p", 0)

    def relative(below: Any, above: Any) -> Any:
        d = above[:2] - below[:2]
        cosine, sine = ca.cos(below[2]), ca.sin(below[2])
        return ca.vertcat(cosine * d[0] + sine * d[1], -sine * d[0] + cosine * d[1])

    before, after = relative(x[:3], x[3:6]), relative(x[6:9], x[9:12])
    turn = (x[11] - x[8]) - (x[5] - x[2])
    return _kernel("carried", True, x, p, ca.vertcat(SCALE * (after - before), turn), 2)


@cache
def kernels() -> tuple[Kernel, ...]:
    """All kernels, in the order of their numbers in the solver."""
    return (_hold(), _pads(), _clear(), _apart(), _beside(), _inside(), _carried())


@cache
def kernel_index(name: str) -> int:
    """Number of a kernel in the solver."""
    return [kernel.name for kernel in kernels()].index(name)


@cache
def reach() -> Any:
    """CasADi function of one closed-form inverse kinematics.

    Inputs (15,): pose (x, y, yaw) and height of the box, pitch, offset, shoulder pan, branch, side,
    torso, lift above the box's place, half length, half height, turn, distance back.
    Outputs (8,): joint values (mirrored for the right arm) and the distance missing to reach (m).
    """
    x = ca.SX.sym("x", 15)
    position, rotation = tool_target(x[:3], x[3] + x[10], x[4], x[5], x[11:15])
    solution = inverse(position, rotation, x[6], x[7], x[8], x[9])
    return ca.Function("reach", [x], [solution])
