"""When a hand may touch a box that it does not hold: as it comes to it, and as it leaves it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.results import Array, Attachment
from guided_lgp.bounds.verify.attachments import carriers, spans
from guided_lgp.logic import Skeleton
from guided_lgp.scene import Scene

APPROACH = 0.12
"""The hand may touch a box that it does not hold while its tool frame is this near (m) to where
it grasps or places it."""
_AT_REST = 1e-3
"""Way (m) on which a box has not been moved."""


@dataclass(frozen=True)
class Touch:
    """A hand may touch a box between two rows of a motion."""

    box: str
    gripper: str
    start: int
    end: int


def touches(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], tools: Mapping[str, Array]
) -> list[Touch]:
    """From where a hand comes to a box that rests, while it holds it, until it has left it.

    A hand has left a box that it let go of when it is far from where that was, or when another
    hand moves the box; the same holds, backwards in time, for a hand that comes.

    Args:
        scene: the initial configuration.
        skeleton: the actions.
        switches: row of each action's switch.
        tools: poses (T, 7) of all tool frames, by gripper.
    """
    rows = len(next(iter(tools.values())))
    ways = _ways(spans(scene.state, skeleton, switches, rows, carriers), tools)
    found = []
    for held in spans(scene.state, skeleton, switches, rows, lambda state: dict(state.held)):
        path, way = tools[held.gripper][:, :3], ways[held.box]
        start = _away(path[held.start :: -1], way[held.start :: -1])
        end = _away(path[held.end :], way[held.end :])
        found.append(Touch(held.box, held.gripper, held.start - start, held.end + end))
    return found


def _ways(carried: Iterable[Attachment], tools: Mapping[str, Array]) -> dict[str, Array]:
    """How far (T,) each box has been carried, by box."""
    steps: dict[str, Array] = {}
    for span in carried:
        path = tools[span.gripper][:, :3]
        way = steps.setdefault(span.box, np.zeros(len(path)))
        moves = np.linalg.norm(np.diff(path[span.start : span.end + 1], axis=0), axis=1)
        way[span.start + 1 : span.end + 1] += moves
    return {box: np.cumsum(way) for box, way in steps.items()}


def _away(path: Array, way: Array) -> int:
    """The first row of a tool's path (T, 3) that is far from its first, or else the last.

    Args:
        path: of the tool frame's origin (m).
        way: (T,) how far the box has been carried.
    """
    far = np.linalg.norm(path - path[0], axis=1) > APPROACH
    far |= np.abs(way - way[0]) > _AT_REST
    return int(np.argmax(far)) if far.any() else len(path) - 1
