"""What stands still around a body and keeps every arm from it."""

from collections.abc import Collection, Sequence

import numpy as np

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.parts import stacked_with
from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.logic import Action
from guided_lgp.scene import Scene

_NEAR = 0.3
"""How far (m) from a body an arm that takes it is looked at: its hand and its forearm."""
_STARTS = 36
"""Of the solver, for a verdict on which a reason rests: three times those of a search."""


def barriers(
    body: str, takings: Sequence[Action], scene: Scene, deadline: Deadline = NEVER
) -> tuple[str, ...]:
    """Obstacles and furniture without which an arm could take a body, alone with its stack.

    If one of them stays where it is, no arm finds a way. There are none where it is not for them.

    Args:
        body: a box.
        takings: the actions that take it at the start.
        scene: with the body.
        deadline: of the verdicts.

    Raises:
        OutOfTimeError: the deadline has passed.
    """

    def takable(without: Collection[str]) -> bool:
        bound = CoarseBound(_alone(body, takings[0], scene, without), _STARTS, deadline=deadline)
        return any(bound.solve((taking,)).feasible for taking in takings)

    needed = _around(body, scene)
    if not needed or not takable(needed):
        return ()
    for name in needed:
        fewer = tuple(other for other in needed if other != name)
        needed = fewer if takable(fewer) else needed
    return needed


def _around(body: str, scene: Scene) -> tuple[str, ...]:
    """What stands still near a body, but for what it stands on."""
    below = body
    while (support := scene.state.support_of(below)) is not None:
        below = support
    (centre,) = (np.array(box.position) for box in scene.movable if box.name == body)
    return tuple(
        other.name
        for other in (*scene.supports, *scene.obstacles)
        if other.name != below
        and np.linalg.norm(other.placement[:3] - centre) - np.linalg.norm(other.convex.half) < _NEAR
    )


def _alone(body: str, taking: Action, scene: Scene, without: Collection[str]) -> Scene:
    """The scene with one stack of boxes, and without some of what stands still."""
    kept = stacked_with((taking,), scene, body)
    return scene.model_copy(
        update={
            "tables": tuple(one for one in scene.tables if one.name not in without),
            "obstacles": tuple(one for one in scene.obstacles if one.name not in without),
            "boxes": tuple(
                box
                for box in scene.boxes
                if (box.name not in without if box.fixed else box.name in kept)
            ),
        }
    )
