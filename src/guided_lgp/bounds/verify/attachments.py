"""When the actions of a skeleton take effect in a motion, from its attachments."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from guided_lgp.bounds.checks import Violation
from guided_lgp.bounds.results import Attachment, Trajectory
from guided_lgp.logic import Skeleton, State, applicable_actions, successor
from guided_lgp.scene import Scene


def switches_of(scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> list[int] | Violation:
    """Index into ``times`` of every action's switch, from the attachments.

    A violation instead, if the samples have an impossible shape or order, the joints are not
    those that move, an action is not applicable, or the attachments are not those of the skeleton.
    """
    rows = len(trajectory.times)
    if (
        trajectory.q.shape != (rows, len(trajectory.joint_names))
        or not np.isfinite(trajectory.q).all()
        or not np.isfinite(trajectory.times).all()
        or not np.all(np.diff(trajectory.times) > 0)
    ):
        return Violation("samples", 0.0)
    if sorted(trajectory.joint_names) != sorted(scene.robot.description.moving_joints):
        return Violation("joint names", 0.0)
    state = scene.state
    switches: list[int] = []
    for index, action in enumerate(skeleton):
        if action not in applicable_actions(state, scene.symbols):
            return Violation("skeleton", 0.0, index)
        before, state = state, successor(state, action)
        switch = _switch(before, state, trajectory, switches[-1] if switches else 0)
        if switch is None:
            return Violation("attachments", 0.0, index)
        switches.append(switch)
    if any(last > then for last, then in pairwise([0, *switches, rows - 1])) or Counter(
        trajectory.attachments
    ) != Counter(spans(scene.state, skeleton, switches, rows, carriers)):
        return Violation("attachments", 0.0, len(skeleton) - 1)
    return switches


def _switch(before: State, after: State, trajectory: Trajectory, last: int) -> int | None:
    """Where an action changes who holds what: as the first attachment starts or one ends there."""
    for box, gripper in sorted(set(after.held) - set(before.held)):
        starts = (a.start for a in trajectory.attachments if (a.box, a.gripper) == (box, gripper))
        return min((start for start in starts if start >= last), default=None)
    for box, gripper in sorted(set(before.held) - set(after.held)):
        ends = (
            attachment.end
            for attachment in trajectory.attachments
            if (attachment.box, attachment.gripper) == (box, gripper) and attachment.start <= last
        )
        return max(ends, default=None)
    return last


def carriers(state: State) -> dict[str, str]:
    """The gripper that carries each box: held, or standing on what is."""
    return {box: gripper for held, gripper in state.held for box in (held, *state.carried_by(held))}


def spans(
    state: State,
    skeleton: Skeleton,
    switches: Sequence[int],
    rows: int,
    carriers: Callable[[State], Mapping[str, str]],
) -> Iterator[Attachment]:
    """Which box is with which gripper from when to when, by the skeleton.

    Args:
        state: at the start.
        skeleton: the actions.
        switches: row of each action's switch.
        rows: how many there are.
        carriers: the gripper of each box in a state.
    """
    since = {box: (gripper, 0) for box, gripper in carriers(state).items()}
    for action, switch in zip(skeleton, switches, strict=True):
        state = successor(state, action)
        now = carriers(state)
        for box in [box for box, (gripper, _) in since.items() if now.get(box) != gripper]:
            yield Attachment(box, *since.pop(box), switch)
        since |= {box: (gripper, switch) for box, gripper in now.items() if box not in since}
    for box, (gripper, start) in since.items():
        yield Attachment(box, gripper, start, rows - 1)
