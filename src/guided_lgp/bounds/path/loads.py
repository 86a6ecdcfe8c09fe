"""What contacts mean for the pads of hands that carry stacks: where they would slip, comes last."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from guided_lgp.bounds.path.grips import Grips
from guided_lgp.bounds.path.placing import Place
from guided_lgp.bounds.path.situation import Situation, matrix_pose, tool_pose
from guided_lgp.bounds.path.task import Task
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms.steady import AT_REST, check
from guided_lgp.poses import IDENTITY, compose, inverse
from guided_lgp.scene.shapes import Vector

Load = tuple[float, Vector]
"""Volume (m³) and centre (m)."""
_PRICE = 100.0
"""Cost of a load that takes all that the pads can carry, beyond what it should: postures cost a few
rad at most, so that a tenth is worth another posture."""


def price_of_grips(task: Task, index: int, grips: Grips) -> Array:
    """What M grips of the body of an action cost (M,) for what the hand carries by them."""
    action = task.manoeuvres[index]
    stacks = list(_stacks(task, index))
    if not (task.firm and stacks):
        return np.zeros(len(grips))
    body, fingers = task.boxes[action.body].convex, task.arms[action.parent].arm.fingers
    tools = map(matrix_pose, grips.rotation, grips.offset)
    level = IDENTITY.tolist()
    return _price(
        max(check(body, level, tool.tolist(), fingers, stack) for stack in stacks) for tool in tools
    )


def price_of_places(
    task: Task,
    index: int,
    situation: Situation,
    boxes: Mapping[str, Array],
    places: Sequence[Place],
) -> Array:
    """What M places of the body of an action cost (M,) for a hand that carries them."""
    action, state = task.manoeuvres[index], task.states[index]
    root = task.root(index, action.parent)
    gripper = state.holder(root)
    if gripper is None or not task.firm:
        return np.zeros(len(places))
    body, arm = task.boxes[root].convex, task.arms[gripper]
    tool, below = tool_pose(arm, situation.q).tolist(), boxes[root].tolist()
    carried = [_load(task, name, boxes[name]) for name in (root, *state.carried_by(root))]
    put = (_stack(task, index, index, place.pose) for place in places)
    return _price(check(body, below, tool, arm.arm.fingers, [*carried, *more]) for more in put)


def _price(shares: Iterator[float]) -> Array:
    """Of shares of what pads can carry."""
    return _PRICE * np.maximum(np.array(list(shares)) - AT_REST, 0.0)


def _stacks(task: Task, index: int) -> Iterator[list[Load]]:
    """What a hand carries with the body of an action, in its frame, whenever that is a stack."""
    later = task.next_move(index)
    for j in range(index, len(task) if later is None else later):
        if task.states[j + 1].carried_by(task.manoeuvres[index].body):
            yield _stack(task, index, j, IDENTITY)


def _stack(task: Task, index: int, at: int, place: Array) -> list[Load]:
    """The body of an action, put at a place (7,), with what the coarse solution has on it then."""
    body, poses = task.manoeuvres[index].body, task.contacts[at].boxes
    moved = compose(place, inverse(poses[body]))
    names = (body, *task.states[at + 1].carried_by(body))
    return [_load(task, name, compose(moved, poses[name])) for name in names]


def _load(task: Task, name: str, placement: Array) -> Load:
    x, y, z = placement[:3].tolist()
    return task.boxes[name].convex.volume, (x, y, z)
