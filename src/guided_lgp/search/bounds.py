"""What a planner needs of the NLP: the two bounds, as a protocol."""

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
