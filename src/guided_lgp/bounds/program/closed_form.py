"""Closed-form inverse kinematics, in CasADi, of arms built like a human's.

``robots/inverse/human_like.py`` says which those are. Unlike the formulas there for exact
solutions, these give the nearest values where a target is out of reach, and are compiled.
"""

from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.kinematics import turned
from guided_lgp.robots.inverse.human_like import AXES, HumanLike


def inverse(
    arm: HumanLike, position: Any, rotation: Any, pan: Any, branch: Any, side: Any, raised: Any
) -> Any:
    """Closed-form inverse kinematics for a given turn about z.

    The first joint's value, ``pan``, is the free parameter of the seven joints. Then the distance
    to the wrist gives the elbow, the wrist's offset from the vertical plane of the shoulder gives
    the roll of the upper arm (two branches), and the remaining rotation gives forearm and wrist.
    Where the target is out of reach, the nearest values are returned.

    Args:
        arm: lengths of the arm.
        position: (3,) target of the tool in the robot's frame (m).
        rotation: (3, 3) target axes of the tool.
        pan: value of the first joint (rad), mirrored for a mirror image.
        branch: 1 or -1, which solution of the upper arm's roll.
        side: 1, or -1 for the mirror image.
        raised: height of the torso (m).

    Returns:
        seven joint values (mirrored for a mirror image) and the distance (m) missing to reach.
    """
    mirror = ca.diag(ca.vertcat(1, side, 1))
    target = ca.mtimes(mirror, position)
    axes = ca.mtimes([mirror, rotation, mirror])
    wrist = target - arm.hand * axes[:, 0] - arm.shoulder - ca.vertcat(0, 0, raised)
    wrist = ca.mtimes(turned(AXES[0], -pan), wrist) - ca.vertcat(arm.lift, 0, 0)
    distance = ca.norm_2(wrist)
    cosine = (distance**2 - arm.upper**2 - arm.fore**2) / (2 * arm.upper * arm.fore)
    elbow = -ca.acos(_clip(cosine))
    along = arm.upper + arm.fore * ca.cos(elbow)
    out = -arm.fore * ca.sin(elbow)
    sine = -wrist[1] / ca.fmax(out, 1e-6)
    roll = ca.asin(_clip(sine))
    roll = ca.if_else(branch > 0, roll, np.pi - roll)
    above = out * ca.cos(roll)
    lift = ca.atan2(above * wrist[0] - along * wrist[2], along * wrist[0] + above * wrist[2])
    forearm = ca.SX.eye(3)
    for axis, angle in zip(AXES, (pan, lift, roll, elbow), strict=False):
        forearm = ca.mtimes(forearm, turned(axis, angle))
    remaining = ca.mtimes(forearm.T, axes)
    flex = -ca.acos(_clip(remaining[0, 0]))
    # x = Rx(q5) Ry(q6) Rx(q7): first column (c6, s5 s6, -c5 s6), first row (c6, s6 s7, s6 c7)
    forearm_roll = ca.atan2(-remaining[1, 0], remaining[2, 0])
    wrist_roll = ca.atan2(-remaining[0, 1], -remaining[0, 2])
    missing = ca.fmax(distance - arm.upper - arm.fore, 0) + out * ca.fmax(ca.fabs(sine) - 1, 0)
    return ca.vertcat(pan, lift, roll, elbow, forearm_roll, flex, wrist_roll, missing)


def _clip(value: Any) -> Any:
    return ca.fmin(ca.fmax(value, -1), 1)
