"""A small scene, scripted bounds and hand-made policies."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from guided_lgp.bounds.results import Array, CoarseResult, Failure, PathResult
from guided_lgp.logic import Action, Objective, Skeleton, State, Symbols
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.search.observation import start

TAB1 = Table(name="tab1", position=(0.54, 0.33, 0.6), half_extents=(0.17, 0.2))
TAB2 = Table(name="tab2", position=(0.54, -0.33, 0.6), half_extents=(0.17, 0.2))
TRAY = Table(name="tray", position=(0.52, 0.0, 0.63), half_extents=(0.1, 0.11))
COLOURS = ("red", "green", "blue", "yellow", "orange")


def make_scene(boxes: int, tray: bool) -> Scene:
    """Boxes on slots of tab1."""
    slots = [(x, y) for x in (0.455, 0.63) for y in (0.19, 0.33, 0.47)]
    return Scene(
        tables=(TAB1, TAB2, TRAY) if tray else (TAB1, TAB2),
        boxes=tuple(
            Box(name=name, size=(0.15, 0.07, 0.1), position=(*slot, 0.65), on="tab1")
            for name, slot in zip(COLOURS[:boxes], slots, strict=False)
        ),
    )


class ScriptedBounds:
    """Bounds whose verdicts follow a rule; counts what it was asked."""

    def __init__(
        self,
        scene: Scene,
        coarse: Callable[[Skeleton], bool] = lambda skeleton: True,
        path: Callable[[Skeleton], bool] = lambda skeleton: True,
    ) -> None:
        self._keyframe = start(scene)
        self._coarse_rule = coarse
        self._path_rule = path
        self.coarse_asked: list[Skeleton] = []
        self.path_asked: list[Skeleton] = []

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        self.coarse_asked.append(skeleton)
        feasible = all(self._coarse_rule(skeleton[: k + 1]) for k in range(len(skeleton)))
        if not feasible:
            return CoarseResult(skeleton, False, failure=_failure(skeleton), time_s=0.25)
        frames = (self._keyframe,) * len(skeleton)
        return CoarseResult(skeleton, True, frames, frames, time_s=0.25)

    def path(self, skeleton: Skeleton) -> PathResult:
        self.path_asked.append(skeleton)
        if not self._path_rule(skeleton):
            return PathResult(skeleton, False, failure=_failure(skeleton), time_s=1.5)
        return PathResult(skeleton, True, time_s=1.5)


def _failure(skeleton: Skeleton) -> Failure:
    return Failure(len(skeleton) - 1, "reach", 0.1, "scripted")


class Scorer:
    """A policy given by a function of the objective, the state and one action."""

    def __init__(self, score: Callable[[Objective, State, Action], float]) -> None:
        self._score = score

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, Array],
        actions: Sequence[Action],
    ) -> Array:
        weights = np.exp([self._score(objective, state, action) for action in actions])
        return np.log(weights / weights.sum())


UNIFORM = Scorer(lambda objective, state, action: 0.0)
