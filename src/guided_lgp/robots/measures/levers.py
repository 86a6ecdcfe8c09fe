"""How far a turn of each joint can move the tool."""

import numpy as np

from guided_lgp.robots.chain import Array, Chain

_SMOOTH = 1e-6
"""Rounds off the lengths' corners (m), where they have no gradient."""


def lever_arms(chain: Chain) -> Array:
    """Bounds (n,) in m: a joint that turns by an angle moves the tool by at most so much per rad.

    Whatever the joints' values, distances between the axes of neighbouring joints do not change. So
    the tool is nowhere farther from an axis than the shortest way to it that touches every axis
    between. The points where it touches may slide along the axes, and its length is convex in them.
    """
    return np.array([_shortest_way(chain, joint) for joint in range(len(chain))])


def _shortest_way(chain: Chain, first: int) -> float:
    from scipy.optimize import minimize

    axes, points = chain.axes[first:], chain.points[first:]

    def length(slides: Array, smooth: float = 0.0) -> float:
        corners = np.concatenate([points + slides[:, None] * axes, chain.position[None]])
        squares = (np.diff(corners, axis=0) ** 2).sum(axis=1)
        return float(np.sqrt(squares + smooth**2).sum())

    start = ((chain.position - points) * axes).sum(axis=1)
    best = minimize(length, start, args=(_SMOOTH,), method="Powell", options={"xtol": 1e-8})
    return min(length(start), length(best.x))
