"""What grasp and place declare, until the domain says it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from guided_lgp.logic import Action


@dataclass(frozen=True)
class GroundTerm:
    """A step whose variables are symbols."""

    name: str
    symbols: tuple[str, ...]
    options: Mapping[str, str | float] = field(default_factory=dict)


@dataclass(frozen=True)
class GroundInstruction:
    """What an action is by its declaration, with symbols in place of variables."""

    action: Action
    actor: str
    body: str
    parent: str
    motion: tuple[GroundTerm, ...]


def bind(action: Action) -> GroundInstruction:
    """What the action is by its declaration."""
    gripper = (action.gripper,)
    coming = GroundTerm("transit", gripper)
    if action.table is None:
        motion = (
            GroundTerm("present", (action.box,)),
            coming,
            GroundTerm("line_in", gripper, {"back": 0.09}),
            GroundTerm("switch", (), {"close": action.gripper}),
            GroundTerm("line_out", gripper, {"up": 0.08}),
            GroundTerm("home", gripper),
        )
        return GroundInstruction(action, action.gripper, action.box, action.gripper, motion)
    motion = (
        GroundTerm("present", (action.table,)),
        coming,
        GroundTerm("line_in", gripper, {"down": 0.08}),
        GroundTerm("switch", (), {"open": action.gripper}),
        GroundTerm("line_out", gripper, {"back": 0.09, "otherwise": "up"}),
        GroundTerm("home", gripper),
    )
    return GroundInstruction(action, action.gripper, action.box, action.table, motion)
