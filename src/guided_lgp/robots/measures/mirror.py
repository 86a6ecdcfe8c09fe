"""Whether one arm is the mirror image of another."""

from dataclasses import dataclass

import numpy as np

from guided_lgp.robots.chain import Array, Chain

_PLANE = np.diag([1.0, -1.0, 1.0])
"""Reflection at the plane y = 0 of the base, and of the tool's closing axis."""
_SAMPLES = 200


@dataclass(frozen=True)
class Mirror:
    """How joint values of one arm become the mirror image with the other."""

    signs: Array
    """(n,) of the joints."""
    error: float
    """Largest distance (m) of the tools' origins, or difference of their axes' entries."""


def mirror_of(first: Chain, second: Chain) -> Mirror | None:
    """Signs that turn joint values of the first arm into its mirror image with the second.

    Both chains must be in the frame of the robot's base. None where the joints do not correspond:
    how well the arms agree otherwise is measured on random configurations.
    """
    if len(first) != len(second):
        return None
    cosines = np.einsum("ij,ij->i", first.axes @ _PLANE, second.axes)
    if np.any(np.abs(cosines) < 0.99):
        return None
    signs = -np.sign(cosines)
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, len(first)))
    rotation, position = first.forward(q)
    turned, reached = second.forward(q * signs)
    apart = np.linalg.norm(reached - position @ _PLANE, axis=-1).max()
    askew = np.abs(turned - _PLANE @ rotation @ _PLANE).max()
    return Mirror(signs, float(max(apart, askew)))
