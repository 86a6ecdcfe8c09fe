"""``apart(gripper, gripper)``: the spheres of two arms keep their distance."""

from array import array
from collections.abc import Iterator
from functools import cache
from itertools import permutations, product

import casadi as ca

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.kernels import SCALE, Kernel, distance, kernel
from guided_lgp.bounds.program.kinematics import ArmKinematics, Chain, RobotKinematics, levers
from guided_lgp.bounds.terms.term import Term
from guided_lgp.logic.declarations import Instruction, Variable


def _kernel(one: Chain, other: Chain, fixed: int) -> Kernel:
    n, m = len(one.moving), len(other.moving)
    x, p = ca.SX.sym("x", n + m), ca.SX.sym("p", 5 + fixed)
    sides, closed, margin, scene = p[:2], p[2:4], p[4], p[5 : 5 + fixed]
    first = one.pose(x[:n], sides[0], scene, closed[0])
    second = other.pose(x[n:], sides[1], scene, closed[1])
    rows = [
        distance(first.spheres[:, i] - second.spheres[:, j])
        - one.spheres[i].radius
        - other.spheres[j].radius
        - margin
        for i, j in product(one.against_arms, other.against_arms)
    ]
    return kernel(f"apart_{one.name}_{other.name}", x, p, SCALE * ca.vertcat(*rows))


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    chains = [(one.chain, other.chain) for one, other in permutations(robot.arms.values(), 2)]
    return tuple(_kernel(*pair, len(robot.fixed)) for pair in dict.fromkeys(chains))


def keep_apart(
    context: Context,
    gripper: str,
    joints: tuple[int, ...],
    other: str,
    others_joints: tuple[int, ...],
) -> None:
    """Of one configuration of each arm."""
    one, two = context.robot.arms[gripper], context.robot.arms[other]
    context.rows(
        f"apart_{one.chain.name}_{two.chain.name}",
        (*joints, *others_joints),
        (
            *(one.side, two.side),
            *(context.closed(gripper), context.closed(other)),
            context.margins.apart,
            *context.fixed,
        ),
        ("apart", gripper, other),
        _links(one, two),
        _levers(one.chain, context.closed(gripper), two.chain, context.closed(other)),
    )


@cache
def _levers(one: Chain, closed: float, other: Chain, others_closed: float) -> "array[float]":
    return array("d", levers(one, closed) + levers(other, others_closed))


@cache
def _links(one: ArmKinematics, two: ArmKinematics) -> tuple[str, ...]:
    """Of the first arm, for each pair of spheres."""
    count = len(two.chain.against_arms)
    return tuple(one.links[i] for i in one.chain.against_arms for _ in range(count))


def _add(context: Context, gripper: str, other: str) -> None:
    """At the switch: the other arm's straight lines from the arm at its contact.

    Every configuration keeps apart from where the other arms stand without being told.
    """
    posed = context.standing | context.acting
    for segment in posed[other].segments:
        keep_apart(context, other, segment.joints, gripper, posed[gripper].joints)


def _needed(one: Instruction) -> Iterator[tuple[Variable, ...]]:
    """Of two hands on one body."""
    if one.into_hand and one.holder is not None:
        yield one.attached.parent, one.holder


TERM = Term(_add, _kernels, needed=_needed)
