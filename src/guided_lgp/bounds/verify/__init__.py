"""Verification of keyframes and paths: what the bounds report as feasible has passed here.

Collisions are judged by PyBullet on the robot's mesh hulls; kinematics, grasps, placements and
limits are computed afresh from the scene, never taken from a solver.

A violation names its constraint. Terms keep their names: ``hold <gripper> <box>`` (the hand is not
where it holds the box), ``pads <gripper> <box>`` (the fingertips are not on its side),
``stand <box> <support>`` (it is tilted, floats or sinks in), ``balanced <box> <support>`` (the
centre of mass of the box and all it carries is not above its support), ``carried <box> <carrier>``
(it moves relative to what holds or supports it), ``level <box>`` (a held box that carries others is
tilted), ``clear <link> <body>``, ``apart <link> <link>`` and ``beside <body> <body>`` (two bodies
overlap). Besides: ``joint limit <joint>``, ``effort <joint>`` (more than the motor has; at rest in
keyframes), and along a path ``jump <joint>``, ``velocity <joint>``, ``acceleration <joint>``,
``fingers <gripper>`` (not closed on the box they carry), ``start`` and ``posture <gripper>`` (not
where the scene has the arms at first, and a goal has one in the end), ``skeleton`` (an action is
not applicable), ``attachments`` (not those of the skeleton), ``samples`` (of impossible shape or
order) and ``joint names`` (not those of arms and fingers, each once).
"""

from guided_lgp.bounds.checks import Violation
from guided_lgp.bounds.verify.keyframes import verify_keyframe, verify_keyframes
from guided_lgp.bounds.verify.path import PathReport, Verify, verify_path

__all__ = [
    "PathReport",
    "Verify",
    "Violation",
    "verify_keyframe",
    "verify_keyframes",
    "verify_path",
]
