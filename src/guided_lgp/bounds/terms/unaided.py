"""``unaided()``: a box that is put down with others on it would stand there without them.

Plans for users ask for it: who takes a counterweight away makes the rest fall. It is a further row
of ``balanced``.
"""

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.terms.term import Term


def _add(context: Context) -> None:
    """Whatever is put down, see :mod:`~guided_lgp.bounds.terms.balanced`."""
    context.unaided = True


TERM = Term(_add, part="lasting")
