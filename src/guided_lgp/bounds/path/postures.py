"""Whether an arm can be at a contact and off it, judged in growing batches.

As a rule one of the first can; where none of them can, a batch takes a fraction of the time.
"""

from guided_lgp.bounds.path.motions import Mover, Pair, Surroundings
from guided_lgp.bounds.results import Array

_GROWTH = 3
"""How many times as many as have been judged are judged next."""


class Postures:
    """Configurations of an arm, the likeliest first."""

    def __init__(self, mover: Mover, at: Surroundings, off: Surroundings, q: Array) -> None:
        """Prepare.

        Args:
            mover: judges them.
            at: what stands still and may be touched at the contact.
            off: the same where the straight way in begins.
            q: (m, 2, n) at the contact and off it.
        """
        self._mover = mover
        self._at, self._off = at, off
        self._q = q
        self._met_at: list[Pair | None] = []
        self._met_off: dict[int, Pair | None] = {}

    def met_at(self, number: int) -> Pair | None:
        """Two bodies in collision at the contact."""
        self._mover.count()
        while number >= len(self._met_at):
            self._judge_more()
        return self._met_at[number]

    def met_off(self, number: int) -> Pair | None:
        """Two bodies in collision off it, for one that is free at the contact."""
        self._mover.count()
        return self._met_off[number]

    def _judge_more(self) -> None:
        known = len(self._met_at)
        batch = self._q[known : known + max(1, _GROWTH * known)]
        self._met_at += self._mover.collisions(self._at, batch[:, 0])
        free = [i for i in range(known, len(self._met_at)) if self._met_at[i] is None]
        found = self._mover.collisions(self._off, self._q[free, 1])
        self._met_off |= dict(zip(free, found, strict=True))
