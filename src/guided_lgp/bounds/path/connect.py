"""RRT-Connect (Kuffner and LaValle, 2000), and shortcuts through its path.

OMPL's planners draw from one global sequence of seeds per process, so a verdict would depend on
what was planned before; this one draws from a generator of its own.
"""

from typing import Protocol

import numpy as np

from guided_lgp.bounds.results import Array

_STEP = 0.5
"""Longest extension of a tree, in the units of the space."""


class Space(Protocol):
    """A space of points (d,), in which straight lines can be followed and checked."""

    low: Array
    high: Array
    scale: Array
    """Weights (d,) of the metric."""

    def free(self, start: Array, end: Array) -> bool:
        """Whether the straight line between two points is free of collisions."""
        ...


class _Tree:
    def __init__(self, root: Array, scale: Array) -> None:
        self.points = [root]
        self.parents = [-1]
        self._scaled = np.empty((64, len(root)))
        self._scale = scale
        self._scaled[0] = root * scale

    def add(self, point: Array, parent: int) -> int:
        count = len(self.points)
        if count == len(self._scaled):
            self._scaled = np.concatenate([self._scaled, np.empty_like(self._scaled)])
        self._scaled[count] = point * self._scale
        self.points.append(point)
        self.parents.append(parent)
        return count

    def nearest(self, point: Array) -> int:
        offset = self._scaled[: len(self.points)] - point * self._scale
        return int(np.argmin(np.einsum("ij,ij->i", offset, offset)))

    def branch(self, node: int) -> list[Array]:
        """Points from a node to the root."""
        points = []
        while node >= 0:
            points.append(self.points[node])
            node = self.parents[node]
        return points


def connect(
    space: Space, start: Array, goal: Array, rng: np.random.Generator, iterations: int
) -> list[Array] | None:
    """Grow one tree from each end until they meet.

    Args:
        space: says which straight lines are free.
        start: point (d,), free of collisions.
        goal: point (d,), free of collisions.
        rng: the only source of randomness.
        iterations: samples to draw before giving up.

    Returns:
        Points of a free polyline from start to goal, or None.
    """
    if space.free(start, goal):
        return [start, goal]
    trees = [_Tree(start, space.scale), _Tree(goal, space.scale)]
    for iteration in range(iterations):
        grown, other = trees[iteration % 2], trees[1 - iteration % 2]
        node = _extend(space, grown, rng.uniform(space.low, space.high))
        if node is None:
            continue
        target = grown.points[node]
        reached = other.nearest(target)
        while True:
            new = _extend(space, other, target, reached)
            if new is None:
                break
            reached = new
            if np.array_equal(other.points[new], target):
                halves = [grown.branch(node), other.branch(new)]
                forward, backward = halves if iteration % 2 == 0 else halves[::-1]
                return forward[::-1] + backward[1:]
    return None


def _extend(space: Space, tree: _Tree, target: Array, origin: int | None = None) -> int | None:
    nearest = tree.nearest(target) if origin is None else origin
    point = tree.points[nearest]
    distance = float(np.linalg.norm((target - point) * space.scale))
    if distance > _STEP:
        target = point + (target - point) * (_STEP / distance)
    if distance == 0.0 or not space.free(point, target):
        return None
    return tree.add(target, nearest)


def shortcut(
    space: Space, path: list[Array], rng: np.random.Generator, attempts: int
) -> list[Array]:
    """Shorten a free polyline: skip corners, then cut between random points of its edges."""
    first = 0
    while first < len(path) - 2:
        for last in range(len(path) - 1, first + 1, -1):
            if space.free(path[first], path[last]):
                del path[first + 1 : last]
                break
        first += 1
    for _ in range(attempts):
        if len(path) < 3:
            break
        first, last = sorted(rng.choice(len(path) - 1, size=2, replace=False))
        begin = path[first] + rng.uniform() * (path[first + 1] - path[first])
        end = path[last] + rng.uniform() * (path[last + 1] - path[last])
        if space.free(begin, end):
            path = [*path[: first + 1], begin, end, *path[last + 1 :]]
    return path
