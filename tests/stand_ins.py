"""What stands in for the bounds where a test needs no geometry, and for a full disk."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager

from guided_lgp.bounds.results import CoarseResult, Failure, PathResult
from guided_lgp.logic import Skeleton
from guided_lgp.params import BoundsParams
from guided_lgp.scene import Scene
from guided_lgp.search.observation import start

FAILURE = Failure(0, "reach", 0.1, "scripted")


class NothingOnBlue:
    """Bounds under which nothing can stand on blue, and nothing on green has a path."""

    def __init__(self, scene: Scene, params: BoundsParams) -> None:
        self._keyframe = start(scene)

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        if any(action.symbols[2:] == ("blue",) for action in skeleton):
            return CoarseResult(skeleton, False, failure=FAILURE, time_s=0.5)
        frames = (self._keyframe,) * len(skeleton)
        return CoarseResult(skeleton, True, frames, frames, time_s=0.5)

    def path(self, skeleton: Skeleton) -> PathResult:
        feasible = all(action.symbols[2:] != ("green",) for action in skeleton)
        return PathResult(skeleton, feasible, failure=None if feasible else FAILURE, time_s=2.0)


@contextmanager
def full_disk() -> Iterator[None]:
    """Here no file gets longer than 500 bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
