"""``upright(box)``: a box stays level on its way, as if it carried others."""

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.terms.term import Term


def _add(context: Context, box: str) -> None:
    """Whatever hand holds it keeps it level, see the term ``level``."""
    context.upright |= {box}


TERM = Term(_add, part="lasting", levels=True)
