"""What all ways to carry out the actions of a skeleton share, and the arm's reach at a contact."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from guided_lgp.bounds.path.grips import Grips
from guided_lgp.bounds.path.ik import REACH, Arm, continuous_near
from guided_lgp.bounds.path.motions import Free, Motion, Mover, Still
from guided_lgp.bounds.path.situation import Situation, Step
from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.logic import Skeleton, successor
from guided_lgp.poses import compose, pose
from guided_lgp.scene import GRIPPERS, Scene
from guided_lgp.scene.pr2 import FINGER_LIMITS, HOME, arm_slice
from guided_lgp.scene.world import initial_poses

APPROACH = 0.09
"""Length (m) of the straight way to a grasp and from a place, along the hand."""
LIFT = 0.08
"""Length (m) of the straight way up after a grasp and down to a place."""
UP = np.array([0.0, 0.0, 1.0])
_PANS = np.linspace(-0.7, 2.28, 15)
"""Pan angles (rad) of the left arm that are tried for every pose, beside the coarse one."""
CONFIGURATIONS = 150
"""Configurations of grip and elbow that are looked at per action and batch of placements."""
ELBOWS = 3
"""Elbow postures per grip or placement whose motions are planned."""
PAN_SHIFTS = (0.0, 0.25, -0.25, 0.5, -0.5)
"""Turns of the pan joint (rad) on the straight way off a box that are tried."""


Choice = tuple[int, int, int]
"""Tool pose, pan angle and side of the elbow."""


@dataclass(frozen=True)
class Outcome:
    """One way to carry out an action."""

    steps: tuple[Step, ...]
    situation: Situation
    contact: Keyframe


@dataclass
class Trouble:
    """The obstacle met farthest on the way through the skeleton."""

    action: int = -1
    stage: int = -1
    constraint: str = "no motion found"

    def note(self, action: int, stage: int, constraint: str) -> None:
        """Remember the obstacle unless one farther on is known."""
        if (action, stage) > (self.action, self.stage):
            self.action, self.stage, self.constraint = action, stage, constraint


@dataclass(frozen=True)
class Reach:
    """Configurations of an arm for N tool poses at a contact and before (or after) it."""

    rotation: Array
    """(N, 3, 3) of the tool frame."""
    contact: Array
    """(N, 3) origin of the tool frame (m)."""
    q: Array
    """(N, 2, P, 2, 7): at the contact and off it, by pan angle and side of the elbow."""
    pans: Array
    """(P,) rad."""
    cost: Array
    """(N, P, 2): distance of the second from the home posture; infinite out of reach."""

    def order(self, extra: Array | None = None) -> list[Choice]:
        """All configurations within reach, cheapest first; ``extra`` (N,) is added to the cost."""
        cost = self.cost if extra is None else self.cost + extra[:, None, None]
        flat = np.argsort(cost, axis=None, kind="stable")
        flat = flat[: int(np.isfinite(cost).sum())]
        return [
            (int(n), int(p), int(s)) for n, p, s in np.transpose(np.unravel_index(flat, cost.shape))
        ]


class Task:
    """One skeleton near one coarse solution, for the search through its actions."""

    def __init__(
        self,
        scene: Scene,
        mover: Mover,
        grips: Mapping[str, tuple[Grips, Grips]],
        skeleton: Skeleton,
        at_switch: Sequence[Keyframe],
        trouble: Trouble,
        seed: int,
    ) -> None:
        self.mover = mover
        self.arms = mover.arms
        self.skeleton = skeleton
        self.at_switch = at_switch
        self.trouble = trouble
        self.rng = np.random.default_rng(np.random.SeedSequence([7, seed]))
        self.boxes = {box.name: box for box in scene.boxes}
        self.tables = {table.name: table for table in scene.tables}
        self.grips = grips
        self.states = [scene.state]
        for action in skeleton:
            self.states.append(successor(self.states[-1], action))
        self.start = Situation(
            scene.state,
            np.concatenate([HOME[gripper] for gripper in GRIPPERS]),
            dict.fromkeys(GRIPPERS, FINGER_LIMITS[0]),
            initial_poses(scene),
            {},
        )

    def root(self, index: int) -> tuple[str | None, str | None]:
        """The lowest body below the place of an action, and who holds it, if anyone."""
        action, state = self.skeleton[index], self.states[index]
        root = action.table if action.instruction == "place" else state.support_of(action.box)
        while root is not None and state.support_of(root) is not None:
            root = state.support_of(root)
        return root, None if root is None else state.holder(root)

    def reach(self, index: int, arm: Arm, rotation: Array, contact: Array, off: Array) -> Reach:
        """Solve the inverse kinematics of N tool poses at the contact and off it."""
        q = self.at_switch[index].q[arm_slice(arm.gripper)]
        pans = np.append(_PANS * arm.sign[0], q[0])
        positions = np.stack([contact, off], axis=1)[:, :, None]
        q, valid = arm.inverse(
            rotation[:, None, None],
            positions,
            np.broadcast_to(pans, (len(contact), 2, len(pans))),
        )
        distance = np.linalg.norm((q[:, 1] - arm.home) * REACH, axis=-1)
        cost = np.where(valid.all(axis=1), distance, np.inf)
        return Reach(rotation, contact, q, pans, cost)

    def level_reach(self, reach: Reach, gripper: str, situation: Situation) -> Reach:
        """What a level motion can reach: the elbow's side stays; the nearest first."""
        now = situation.q[arm_slice(gripper)]
        side = self.mover.side(gripper, now)
        distance = np.linalg.norm((continuous_near(reach.q[:, 1], now) - now) * REACH, axis=-1)
        cost = np.where(np.isfinite(reach.cost), distance, np.inf)
        cost[..., 1 - side] = np.inf
        return replace(reach, cost=cost)

    def ways(
        self,
        index: int,
        reach: Reach,
        order: Sequence[Choice],
        stills: tuple[tuple[Still, str], tuple[Still, str]],
        planned: Callable[[Choice], Outcome | None],
        possible: Callable[[int], bool] = lambda pose: True,
    ) -> Iterator[Outcome]:
        """Carry out an action with the nearest configurations that are free of collisions.

        Args:
            index: of the action.
            reach: configurations for every pose of the tool.
            order: of the configurations; the first :data:`CONFIGURATIONS` are looked at.
            stills: what stands still at the contact and off it, and the name of a collision there.
            planned: plans all motions from one of the configurations.
            possible: whether a pose of the tool is worth planning; asked before any motion is.
        """
        attempts = np.zeros(len(reach.cost), dtype=int)
        for choice in order[:CONFIGURATIONS]:
            pose, pan, side = choice
            if attempts[pose] >= ELBOWS:
                continue
            if self._collides(index, reach.q[pose, :, pan, side], stills) or not possible(pose):
                continue
            attempts[pose] += 1
            outcome = planned(choice)
            if outcome is not None:
                attempts[pose] = ELBOWS
                yield outcome

    def _collides(self, index: int, q: Array, stills: Sequence[tuple[Still, str]]) -> bool:
        """Whether joints (2, 7) at the contact or off it collide, and note it."""
        for stage, (joints, (still, name)) in enumerate(zip(q, stills, strict=True), 1):
            blocked = self.mover.collision(still, joints[None])
            if blocked is not None:
                self.note(index, stage, f"{name} collision", blocked)
                return True
        return False

    def transit(self, still: Still, start: Array, goal: Array, level: bool) -> list[Motion] | None:
        """A free motion to joints ``goal`` (7,), with rests at some corners, or None."""
        plan = self.mover.level_transit if level else self.mover.transit
        paths = plan(still, start, goal, self.rng)
        free = Free(still, level)
        return None if paths is None else [Motion(still.mode.gripper, p, free) for p in paths]

    def after(self, situation: Situation, steps: Sequence[Step]) -> Situation:
        """The situation after steps."""
        for step in steps:
            situation = situation.after(step, self.arms)
        return situation

    def top(self, table: str, keyframe: Keyframe) -> Array:
        """Pose (7,) of the top of a table or box."""
        if table in self.tables:
            return pose(self.tables[table].position, self.tables[table].yaw)
        return compose(keyframe.boxes[table], pose((0, 0, self.boxes[table].size[2] / 2)))

    def half(self, box: str) -> Array:
        """Half extents (2,) of a box's top (m)."""
        return np.array(self.boxes[box].size[:2]) / 2

    def note(self, action: int, stage: int, what: str, pair: tuple[str, str]) -> None:
        """Remember two bodies in collision as the obstacle of an action."""
        self.trouble.note(action, stage, f"{what} {' '.join(pair)}")


def retreats(approach: Array) -> list[Array]:
    """Directions (m) in which the open hand leaves a box: back, back and up, up."""
    return [-APPROACH * approach, APPROACH * (0.5 * UP - approach), 0.11 * UP]
