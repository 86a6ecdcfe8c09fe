"""Verification of keyframes and paths: what the bounds report as feasible has passed here.

Collisions are judged by PyBullet on the robot's mesh hulls; kinematics, grasps, placements and
limits are computed afresh from the scene, never taken from a solver (DESIGN §4).

A violation names its constraint: ``joint limit <joint>``, ``collision <body> <body>``,
``grasp <box>`` (the gripper is not at the box), ``level <box>`` (a box that stands, or carries
another, is tilted), ``height <box>`` (it floats above or sinks into its support), ``balance <box>``
(the centre of mass of the box and all it carries is not above its support), ``rigid <box>`` (it
moves relative to what holds or supports it); and along a path also ``jump <joint>``,
``velocity <joint>``, ``acceleration <joint>``, ``fingers <gripper>`` (not closed on the box they
carry), ``start`` (not with both arms at their side), ``skeleton`` (an action is not applicable),
``attachments`` (not those of the skeleton), ``samples`` (of impossible shape or order) and
``joint names`` (not those of arms and fingers, each once).
"""

from guided_lgp.bounds.checks import Violation
from guided_lgp.bounds.verify.keyframes import verify_keyframe, verify_keyframes
from guided_lgp.bounds.verify.path import PathReport, verify_path

__all__ = ["PathReport", "Violation", "verify_keyframe", "verify_keyframes", "verify_path"]
