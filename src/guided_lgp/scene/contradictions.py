"""Goals for places that cannot hold together, found before any planning.

Refused is what no geometry mends: two places of one body, one place of two bodies, a region that
its body does not fit into. Around its middle a body has a disc to itself.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.logic import Goal, Objective
from guided_lgp.poses import Array, apply, inverse, pose
from guided_lgp.scene.bodies import Box, Table
from guided_lgp.scene.footprints import inner_radius
from guided_lgp.scene.model import Scene
from guided_lgp.scene.tolerances import MARGIN


def check_places(objective: Objective, scene: Scene) -> None:
    """Refuse goals whose places contradict each other.

    Args:
        objective: complete, see :func:`~guided_lgp.scene.goals.complete_objective`.
        scene: with the bodies.

    Raises:
        InputError: names the goals.
    """
    places = list(_places(objective, scene))
    for place in places:
        if not place.is_pose:
            _check_room(place)
    for one, other in combinations(places, 2):
        fault = _contradiction(one, other)
        if fault:
            text = f"{one.goal} and {other.goal} contradict each other: {fault}"
            raise InputError("objective", text)


@dataclass(frozen=True)
class _Place:
    """Where one goal wants a body to be: at a pose, or in a region of a support."""

    goal: Goal
    body: Box
    support: Table | Box
    moves: bool
    """Whether the support may move."""
    numbers: Mapping[str, float]

    @property
    def is_pose(self) -> bool:
        return "yaw" in self.numbers

    @property
    def centre(self) -> Array:
        """Of the pose (3,) in the world (m)."""
        return np.array([self.numbers[name] for name in "xyz"])

    def span(self) -> tuple[Array, Array]:
        """Least and greatest x and y (2,) of the body's middle on the support (m)."""
        if self.is_pose:
            frame = pose(self.support.position, self.support.yaw)
            middle, tolerance = apply(inverse(frame), self.centre)[:2], self.numbers["tolerance"]
            return middle - tolerance, middle + tolerance
        low, high = self._corners()
        return low + inner_radius(self.body), high - inner_radius(self.body)

    @property
    def region(self) -> Array:
        """Extents (2,) of the region (m)."""
        low, high = self._corners()
        return high - low

    def _corners(self) -> tuple[Array, Array]:
        low, high = (np.array([self.numbers[f"{axis}{end}"] for axis in "xy"]) for end in (0, 1))
        return low, high


def _places(objective: Objective, scene: Scene) -> Iterator[_Place]:
    movable = {box.name: box for box in scene.movable}
    supports = movable | {support.name: support for support in scene.supports}
    for goal in objective:
        for term in scene.symbols.domain.final_terms(goal):
            body, support = term.symbols
            numbers = {name: float(value) for name, value in term.options.items()}
            yield _Place(goal, movable[body], supports[support], support in movable, numbers)


def _check_room(place: _Place) -> None:
    """The body fits into the region, and part of that is above the support's top."""
    low, high = place.span()
    if np.any(high < low - MARGIN):
        accepted = f"{2 * inner_radius(place.body):.3f} m or more either way"
        raise InputError(f"goal {place.goal}", f"no room for {place.body.name}", accepted)
    length, width = sorted(place.body.size[:2], reverse=True)
    if place.body.shape == "box" and not place.is_pose and not _fits(length, width, place.region):
        accepted = f"room for {length:.3f} by {width:.3f} m, turned in any way"
        raise InputError(f"goal {place.goal}", f"no room for {place.body.name}", accepted)
    rest = np.array(place.support.convex.rest) + inner_radius(place.body)
    if np.any(low > rest) or np.any(high < -rest):
        accepted = "from the middle of its top, up to ({:.3f}, {:.3f}) m".format(*rest)
        fault = f"the region is beside {place.support.name}"
        raise InputError(f"goal {place.goal}", fault, accepted)


def _fits(length: float, width: float, region: Array) -> bool:
    """Whether a rectangle fits into another one, turned in any way (Carver, 1957)."""
    short, long = sorted(region + MARGIN)
    if length <= long:
        return bool(width <= short)
    square = length**2 + width**2
    across = math.sqrt(square - long**2)
    return bool(short * square >= 2 * length * width * long + (length**2 - width**2) * across)


def _contradiction(one: _Place, other: _Place) -> str | None:
    """Why two places cannot both be taken."""
    if one.body.name == other.body.name:
        return f"{one.body.name} is in one place only" if _apart(one, other) else None
    if one.is_pose and other.is_pose and _meet(one, other):
        return f"{one.body.name} and {other.body.name} would be in each other"
    return None


def _apart(one: _Place, other: _Place) -> bool:
    """Whether one body cannot be in both places, which are on one support."""
    if one.is_pose and other.is_pose:
        turn = math.remainder(one.numbers["yaw"] - other.numbers["yaw"], math.tau)
        if abs(turn) > one.numbers["turn"] + other.numbers["turn"]:
            return True
    elif one.moves and one.is_pose != other.is_pose:
        return False  # a region moves with its support
    (low, high), (least, most) = one.span(), other.span()
    return bool(np.any(np.minimum(high, most) < np.maximum(low, least) - MARGIN))


def _meet(one: _Place, other: _Place) -> bool:
    """Whether two bodies at their poses are in each other, wherever the tolerances put them."""
    x, y, z = (one.centre - other.centre).tolist()
    loose = one.numbers["tolerance"] + other.numbers["tolerance"] + MARGIN
    beside = math.hypot(x, y) + loose >= inner_radius(one.body) + inner_radius(other.body)
    above = abs(z) + loose >= (one.body.size[2] + other.body.size[2]) / 2
    return not beside and not above
