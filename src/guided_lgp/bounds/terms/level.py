"""``level(box)``: a hand whose box carries others keeps it level, lifted from where it stood."""

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.terms.hold import configuration
from guided_lgp.bounds.terms.term import Term

CARRY_ANGLE = 0.05
"""Tilt (rad) up to which a box that carries others is level while it moves."""
LIFT = 0.08
"""How far a box that carries others is lifted (m)."""


def _add(context: Context, box: str) -> None:
    """The box with all that it carries is lifted; the arm stays there."""
    for name in (box, *context.state.carried_by(box)):
        context.pose[name] = context.pose[name].raised(LIFT)
    held = context.held[box]
    context.standing[held.gripper] = configuration(context, held, context.pose[box])


TERM = Term(_add)
