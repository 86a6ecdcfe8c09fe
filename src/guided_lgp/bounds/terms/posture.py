"""``posture(gripper)``: an arm ends at given joint values, by the last motions of a path."""

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.terms.term import Term


def _add(context: Context, gripper: str, **values: float) -> None:
    """At keyframes, arms are at their contacts or at their side."""


TERM = Term(_add, part="postures")
