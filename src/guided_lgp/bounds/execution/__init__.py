"""Execution of plans under gravity in PyBullet.

Joints are driven along the trajectory by motors with the robot's effort limits, at 480 steps per
second, and at 960 where friction holds the boxes. A box is taken only if the simulated gripper
really is at the simulated box at that moment: by a fixed constraint at the pose that they happen to
have, or by the friction of fingers that press with a force. Hand and handled box touch each other
like all bodies, except while the fingers close, hold and open, and until hulls that bridge the
hollow of the fingers are out of the box. Boxes that ride on a held box ride by friction. Nothing is
ever set to a pose after the start.

Beside faults with the names of terms (``pads pr2L red``: the fingertips are not on its side;
``stand red tab1``: let go of above its support), an execution ends with ``knock <gripper> <box>``
where a hand has pushed what it is about to take, and ``drift <box>`` where a box is not where the
plan leaves it.
"""

from guided_lgp.bounds.execution.conditions import Conditions
from guided_lgp.bounds.execution.run import Execution, PhysicsReport, execute, final_boxes

__all__ = ["Conditions", "Execution", "PhysicsReport", "execute", "final_boxes"]
