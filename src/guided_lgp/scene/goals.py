"""Goals that say more than symbols, read against a scene."""

import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.logic import Goal, Objective
from guided_lgp.poses import Array
from guided_lgp.scene.bodies import METRES, RADIANS, Box, Table
from guided_lgp.scene.footprints import footprint, gap, gaps, inset
from guided_lgp.scene.model import Scene
from guided_lgp.scene.tolerances import FLOAT

_MOST = {"x": 10.0, "y": 10.0, "z": 10.0, "yaw": 2 * math.pi, "turn": math.pi}
"""Largest numbers of poses (m or rad); what is larger is suspected to be in another unit."""
_LARGEST = 100.0
"""Of every other number that a goal may give (m or rad)."""


def complete_objective(objective: Objective, scene: Scene) -> Objective:
    """The objective with what its goals may leave out: the support on which a pose stands.

    Raises:
        InputError: a number cannot be read or is out of range, nothing is below a pose, or an arm
            has other joints than a posture, or more than one posture.
    """
    complete = tuple(dict.fromkeys(_complete(goal, scene) for goal in objective))
    _check_postures(complete, scene)
    return complete


def in_the_way(body: str, objective: Objective, scene: Scene) -> frozenset[str]:
    """The boxes that stand, at the start, where goals want another box to be in the end."""
    found: set[str] = set()
    box = next(box for box in scene.movable if box.name == body)
    for goal in objective:
        for term in scene.symbols.domain.final_terms(goal):
            if term.symbols[0] == body and "yaw" in term.options:
                found |= _overlapped(box, term.options, scene)
            elif term.symbols[0] == body and "x0" in term.options:
                found |= _filling(box, term.symbols[1], term.options, scene)
    return frozenset(found)


def _overlapped(body: Box, numbers: Mapping[str, str | float], scene: Scene) -> set[str]:
    """The other boxes that a box overlaps where its goal is."""
    x, y, z, yaw = (float(numbers[name]) for name in ("x", "y", "z", "yaw"))
    there = body.model_copy(update={"position": (x, y, z), "yaw": yaw})
    return {
        other.name
        for other in scene.movable
        if other.name != body.name
        and abs(other.position[2] - z) < (body.size[2] + other.size[2]) / 2 - FLOAT
        and gap(footprint(there), footprint(other)) < 0
    }


def _filling(body: Box, support: str, numbers: Mapping[str, str | float], scene: Scene) -> set[str]:
    """The boxes beside which a box has no place in a region: one of them, if that is enough."""
    places = _places(body, support, numbers, scene)
    around = [box for box in scene.movable if box.on == support and box.name != body.name]
    taken = {box.name: gaps(places, footprint(box)[None])[:, 0] < 0 for box in around}
    if not len(places) or not _full(taken.values()):
        return set()
    for name in taken:
        if not _full(where for other, where in taken.items() if other != name):
            return {name}
    return {name for name, where in taken.items() if where.any()}


def _full(taken: Iterable[NDArray[np.bool_]]) -> bool:
    """Whether every place is taken by one of some boxes."""
    several = list(taken)
    return bool(several and np.any(several, axis=0).all())


def _places(body: Box, support: str, numbers: Mapping[str, str | float], scene: Scene) -> Array:
    """Footprints (n, 4, 2) of a body all over a region of a support."""
    (below,) = (one for one in (*scene.supports, *scene.movable) if one.name == support)
    x0, y0, x1, y1 = (float(numbers[name]) for name in ("x0", "y0", "x1", "y1"))
    axes = np.linspace(x0, x1, _GRID), np.linspace(y0, y1, _GRID), np.linspace(0, np.pi, _TURNS)
    x, y, turns = np.reshape(np.meshgrid(*axes), (3, -1))
    standing = footprint(body.model_copy(update={"position": (0.0, 0.0, 0.0), "yaw": 0.0}))
    corners = np.stack([x, y], axis=1)[:, None] + _turned(standing, turns)
    inside = (corners >= [x0, y0]).all(axis=(1, 2)) & (corners <= [x1, y1]).all(axis=(1, 2))
    return np.array(below.position[:2]) + _turned(corners[inside], np.array([below.yaw]))


def _turned(corners: Array, angles: Array) -> Array:
    """Points (..., 4, 2) turned by angles (n,)."""
    c, s = np.cos(angles), np.sin(angles)
    turns = np.stack([c, s, -s, c], axis=-1).reshape(-1, 2, 2)
    return np.asarray(corners @ turns)


_GRID, _TURNS = 15, 9
"""Steps along either side of a region, and over half a turn, at which a box is put there."""


def _complete(goal: Goal, scene: Scene) -> Goal:
    domain = scene.symbols.domain
    for one in domain.further_goals:
        if one.name == goal.kind and one.derived is not None:
            place = one.parameters.index(one.derived)
            if _is_number(goal.symbols[place : place + 1]):
                goal = _with_support(goal, place, scene)
    for term in domain.final_terms(goal):
        _check_numbers(goal, term.options)
    return goal


def _is_number(words: tuple[str, ...]) -> bool:
    try:
        return bool([float(word) for word in words])
    except ValueError:
        return False


def _with_support(goal: Goal, place: int, scene: Scene) -> Goal:
    """The goal with the name of the support whose top is where its box would stand."""
    body = next((box for box in scene.movable if box.name in goal.symbols[:place]), None)
    if body is None:
        raise InputError(f"goal {goal}", "unknown box", ", ".join(scene.symbols.boxes))
    for support in (*scene.supports, *scene.movable):
        symbols = (*goal.symbols[:place], support.name, *goal.symbols[place:])
        whole = Goal(goal.kind, symbols)
        (term,) = scene.symbols.domain.final_terms(whole)
        _check_numbers(goal, term.options)
        if support.name != body.name and _stands(body, support, term.options):
            return whole
    heights = ", ".join(f"z = {z:.3f} on {name}" for name, z in _heights(body, scene))
    raise InputError(f"goal {goal}", f"nothing is there for {body.name} to stand on", heights)


def _stands(body: Box, support: Table | Box, numbers: Mapping[str, str | float]) -> bool:
    """Whether the body would stand on the top of a support, where that is at the start."""
    x, y, z, tolerance = (float(numbers[name]) for name in ("x", "y", "z", "tolerance"))
    height = support.top[2] + body.size[2] / 2
    return abs(z - height) <= tolerance and bool(inset(footprint(support), np.array([x, y])) >= 0)


def _heights(body: Box, scene: Scene) -> Iterator[tuple[str, float]]:
    for support in scene.supports:
        yield support.name, support.top[2] + body.size[2] / 2


def _check_postures(objective: Objective, scene: Scene) -> None:
    """Joint values are those of an arm, and within its limits; each arm ends in one posture."""
    arms, postures = scene.robot.description.arms, dict[str, Goal]()
    for goal in objective:
        for term in scene.symbols.domain.posture_terms(goal):
            arm = arms.get(term.symbols[0])
            if arm is None:  # refused with all unknown symbols
                continue
            if postures.setdefault(arm.gripper, goal) != goal:
                raise InputError("objective", f"{arm.gripper} is to end in two postures")
            if len(term.options) != len(arm.joints):
                fault = f"{len(term.options)} values for {len(arm.joints)} joints"
                raise InputError(f"goal {goal}", fault, ", ".join(arm.joints))
            for joint, value, (low, high) in zip(
                arm.joints, term.options.values(), arm.limits, strict=True
            ):
                if not low <= float(value) <= high:
                    accepted = f"{low:.3f} to {high:.3f}"
                    raise InputError(f"goal {goal}", f"{joint} is {value}", accepted)


def _check_numbers(goal: Goal, numbers: Mapping[str, str | float]) -> None:
    for name, value in numbers.items():
        if abs(float(value)) > _MOST.get(name, math.inf):
            hint = RADIANS if name in ("yaw", "turn") else METRES
            raise InputError(f"goal {goal}", f"{name} is {value}: {hint}")
        if abs(float(value)) > _LARGEST:
            raise InputError(f"goal {goal}", f"{name} is {value}", f"up to {_LARGEST:g} m or rad")
        if name in ("tolerance", "turn") and float(value) <= 0:
            raise InputError(f"goal {goal}", f"{name} is {value}", "more than 0")
    for axis in ("x", "y"):
        if f"{axis}0" in numbers and float(numbers[f"{axis}0"]) >= float(numbers[f"{axis}1"]):
            raise InputError(f"goal {goal}", "the region is empty", f"{axis}0 less than {axis}1")
