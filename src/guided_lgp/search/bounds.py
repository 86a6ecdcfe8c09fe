"""What a planner needs of the NLP: the two bounds, and what is known before they are asked."""

from typing import Protocol

from guided_lgp.bounds.results import CoarseResult, PathResult
from guided_lgp.logic import Skeleton


class Bounds(Protocol):
    """The bounds of the NLP for one scene.

    A verdict depends only on the scene and the skeleton, never on what was asked before.
    """

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """P_coarse(a_1:K) (paper, eq. 3)."""
        ...

    def path(self, skeleton: Skeleton) -> PathResult:
        """P(a_1:K) (paper, eq. 4)."""
        ...


class Parts(Protocol):
    """What small parts of a scene say about the whole, for the searches that make use of it."""

    def out_of_reach(self, skeleton: Skeleton) -> bool:
        """Whether it is proved that an arm cannot reach what the last action of a sequence asks."""
        ...

    def part(self, boxes: frozenset[str], skeleton: Skeleton) -> CoarseResult:
        """P_coarse of what is done with some boxes, the others being absent."""
        ...


class NoParts:
    """Parts that say nothing about the whole."""

    def out_of_reach(self, skeleton: Skeleton) -> bool:
        """See :class:`Parts`."""
        return False

    def part(self, boxes: frozenset[str], skeleton: Skeleton) -> CoarseResult:
        """See :class:`Parts`."""
        return CoarseResult(skeleton, feasible=True)
