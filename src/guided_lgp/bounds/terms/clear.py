"""``clear(gripper, body)``: the spheres of an arm keep their distance from a level box or table."""

from array import array
from collections.abc import Iterable
from functools import lru_cache, partial
from math import hypot
from typing import Any

import casadi as ca

from guided_lgp.bounds.program.arrays import Instance, Instances
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.kernels import SCALE, Kernel, Shared, distance, in_frame, kernel
from guided_lgp.bounds.program.kinematics import Chain, RobotKinematics, levers
from guided_lgp.bounds.terms.term import Term


def _kernel(chain: Chain, fixed: int) -> Kernel:
    n, name = len(chain.moving), f"clear_{chain.name}"
    x, p = ca.SX.sym("x", n + 4), ca.SX.sym("p", 7 + fixed)
    side, scene, closed = p[0], p[1 : 1 + fixed], p[1 + fixed]
    centres = ca.densify(chain.pose(x[:n], side, scene, closed).spheres)
    symbols = ca.SX.sym("centres", *centres.shape)
    rows = partial(_rows, chain, x[n:], p[2 + fixed :])
    shared = Shared(
        inputs=n,
        parameters=2 + fixed,
        values=ca.Function(f"{name}_centres", [x, p], [centres]),
        rows=ca.Function(f"{name}_rows", [x, p, symbols], [rows(symbols)]),
    )
    return kernel(name, x, p, rows(centres), shared=shared)


def _rows(chain: Chain, pose: Any, p: Any, centres: Any) -> Any:
    """How far the spheres are from a body, beyond the margin (scaled).

    Args:
        chain: with the spheres.
        pose: x, y, yaw and z of the body.
        p: offset of z, half the body's size (3,), and the margin (m).
        centres: (3, spheres) m.
    """
    half, margin, rows = p[1:4], p[4], []
    for i, sphere in enumerate(chain.spheres):
        d = centres[:, i] - ca.vertcat(pose[0], pose[1], pose[3] + p[0])
        outside = ca.fabs(ca.vertcat(*in_frame(pose[2], d), d[2])) - half
        inside = ca.fmin(ca.fmax(ca.fmax(outside[0], outside[1]), outside[2]), 0)
        rows.append(SCALE * (distance(ca.fmax(outside, 0)) + inside - sphere.radius - margin))
    return ca.vertcat(*rows)


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(_kernel(chain, len(robot.fixed)) for chain in robot.chains)


def surroundings(context: Context, gripper: str, bodies: Iterable[str]) -> Instances:
    """The rows of an arm, wherever it is, that keep it clear of some bodies."""
    arm, closed = context.robot.arms[gripper], context.closed(gripper)
    number = context.program.number(f"clear_{arm.chain.name}")
    own, reach = (*context.arm_parameters(arm), closed), levers(arm.chain, closed)
    names = tuple(bodies)
    poses = [context.pose[name] for name in names]
    places = tuple([(context.pose[name].offset, *context.half(name)) for name in names])
    return Instances(
        [Instance(context.action, number, ("clear", gripper, name), arm.links) for name in names],
        array("i", [number]) * len(names),
        [(*pose.plane, pose.z) for pose in poses],
        *_numbers(own, reach, places, context.margins.clear),
    )


@lru_cache(maxsize=1024)
def _numbers(
    own: tuple[float, ...],
    reach: tuple[float, ...],
    places: tuple[tuple[float, ...], ...],
    margin: float,
) -> tuple["array[float]", "array[float]"]:
    """Parameters and levers of an arm and bodies: they stand at few heights, in all skeletons."""
    parameters, ways = array("d"), array("d")
    for offset, x, y, z in places:
        parameters.extend((*own, offset, x, y, z, margin))
        ways.extend((*reach, SCALE, SCALE, SCALE * hypot(x, y), SCALE))
    return parameters, ways


def _add(context: Context, gripper: str, body: str) -> None:
    """Where the arm stands, or is at the switch."""
    posed = (context.standing | context.acting).get(gripper)
    joints = context.home[gripper] if posed is None else posed.joints
    context.program.repeat(surroundings(context, gripper, (body,)), joints)


TERM = Term(_add, _kernels)
