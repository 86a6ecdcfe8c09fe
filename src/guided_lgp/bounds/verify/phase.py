"""The motion of a plan in one mode, in small steps, and the boxes along it."""

from collections.abc import Collection, Iterable, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.checks import Violation, box_sizes
from guided_lgp.bounds.collision import CollisionChecker, PlanningScene, checker_of
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms.level import CARRY_ANGLE
from guided_lgp.bounds.verify.touching import Touch
from guided_lgp.logic import State
from guided_lgp.poses import apply, compose, inverse, tilt
from guided_lgp.robots import Arm
from guided_lgp.scene import Scene
from guided_lgp.scene.world import Penetration, World

STEP = 0.01
"""Longest way (m) that any point of robot or load goes between two checked configurations."""
_COARSE_STEP = 0.02
"""Longest way (m), by the levers' bound, between samples at which ways are measured."""
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


class Phase:
    """The motion in one mode, in steps of at most ``STEP``, and the boxes along it."""

    def __init__(
        self, scene: Scene, state: State, boxes: Mapping[str, Array], q: Array, times: Array
    ) -> None:
        robot = scene.robot.description
        self.scene, self.state = scene, state
        self._robot = robot
        self._arms = len(robot.joint_names)
        self._start = dict(boxes)
        tools = scene.robot.tool_poses(q[:1, : self._arms])
        self.grips: dict[str, tuple[str, Array]] = {}
        """Gripper, and pose (7,) in its tool frame, of every box that moves with one."""
        for held, gripper in state.held:
            for box in (held, *state.carried_by(held)):
                self.grips[box] = gripper, compose(inverse(tools[gripper][0]), boxes[box])
        reach = {gripper: arm.hand_radius for gripper, arm in robot.arms.items()}
        sizes = box_sizes(scene)
        for box, (gripper, grip) in self.grips.items():
            corners = apply(grip, np.array(sizes[box]) / 2 * _CORNERS)
            reach[gripper] = max(reach[gripper], float(np.linalg.norm(corners, axis=1).max()))
        self.q, self.times = resample(scene, q, times, reach)
        self._tools = scene.robot.tool_poses(self.q[:, : self._arms])
        self._moving = {
            box: compose(self._tools[gripper], grip) for box, (gripper, grip) in self.grips.items()
        }

    def boxes_at(self, sample: int) -> dict[str, Array]:
        """Pose (7,) of every box."""
        return self._start | {box: poses[sample] for box, poses in self._moving.items()}

    def show(self, world: World, sample: int, everything: bool) -> None:
        """Put arms and boxes where they are at a sample; only those that move, or everything."""
        fingers = self._robot.finger_values(self.q[sample])
        moved = {box: poses[sample] for box, poses in self._moving.items()}
        boxes = self.boxes_at(sample) if everything else moved
        world.set(self.q[sample, : self._arms], boxes, fingers)

    def overlaps(self, world: World, sample: int) -> list[Penetration]:
        """What the world finds at a sample, whatever its depth, deepest first.

        Bodies and what they stand on may touch, so that they are not measured.
        """
        self.show(world, sample, everything=sample == 0)
        return world.penetrations(0.0, self.state.support)

    def crowded(self) -> NDArray[np.bool_]:
        """In which samples coal finds bodies nearer to each other than its padding, hands and what
        they hold apart.
        """
        return ~self._checker().free(self.q)

    def gaps(self, samples: NDArray[np.intp]) -> tuple[list[tuple[str, str]], NDArray[np.float32]]:
        """Pairs (p) of bodies of which one moves, but hands and what they hold, and what their
        distances (m, p) are at least (m) at samples (m,).
        """
        return self._checker().gaps(self.q[samples])

    def _checker(self) -> CollisionChecker:
        """What is where in this mode, all arms moving."""
        first, *others = self._robot.grippers
        standing = {box: pose for box, pose in self._start.items() if box not in self.grips}
        held = frozenset(frozenset(pair) for pair in self.state.held)
        checker = checker_of(self.scene)
        checker.enter(PlanningScene(first, standing, self.grips, held, frozenset(others)))
        return checker

    def tools_at(self, sample: int) -> dict[str, Array]:
        """Pose (7,) of all tool frames."""
        return {gripper: poses[sample] for gripper, poses in self._tools.items()}

    def touches(self, allowed: Iterable[Touch], times: Array) -> list[set[tuple[str, str]]]:
        """For each sample, the pairs of a box and a gripper that may touch it.

        Args:
            allowed: between rows of the motion.
            times: (T,) s, of these rows.
        """
        touches: list[set[tuple[str, str]]] = [set() for _ in self.q]
        for touch in allowed:
            first, last = np.searchsorted(self.times, times[[touch.start, touch.end]])
            for sample in range(first, min(last + 1, len(touches))):
                touches[sample].add((touch.box, touch.gripper))
        return touches

    def tilt_fault(self, upright: Collection[str] = ()) -> Violation | None:
        """A box that carries others, or is carried, must stay level, and so must some others."""
        for held, _ in self.state.held:
            if held in upright or self.state.standing_on(held):
                tilted = tilt(self._moving[held])
                if tilted.max() > CARRY_ANGLE:
                    time = float(self.times[np.argmax(tilted > CARRY_ANGLE)])
                    return Violation(f"level {held}", float(tilted.max()), time=time)
        return None


def resample(
    scene: Scene, q: Array, times: Array, reach: Mapping[str, float]
) -> tuple[Array, Array]:
    """Walk along samples so that no point of robot or load moves more than ``STEP`` between two.

    Args:
        scene: gives the robot and where it stands.
        q: (T, m) all moving joints (rad or m).
        times: (T,) s.
        reach: how far (m) each hand and its load extend beyond the tool frame, by gripper.

    Returns:
        the new samples (n, m) and their times (n,).
    """
    turns = np.abs(np.diff(q, axis=0))
    arms = scene.robot.description.arms.values()
    bounds = [turns[:, arm.slice] @ (arm.lever_arms + reach[arm.gripper]) for arm in arms]
    samples = np.column_stack([q, times])
    samples = _at_steps(samples, np.max(bounds, axis=0), _COARSE_STEP)
    fingers = [_finger_ways(samples, arm) for arm in arms]
    ways = [_longest_ways(scene, samples, arm, reach[arm.gripper]) for arm in arms]
    samples = _at_steps(samples, np.max(ways, axis=0) + np.max(fingers, axis=0), STEP)
    return samples[:, :-1], samples[:, -1]


def _finger_ways(samples: Array, arm: Arm) -> Array:
    """How far (T - 1,) a fingertip moves at most in the hand between samples."""
    turns = np.abs(np.diff(samples[:, arm.fingers.slice], axis=0))
    return np.asarray(arm.fingers.lever * turns.max(axis=1, initial=0.0))


def _longest_ways(scene: Scene, samples: Array, arm: Arm, reach: float) -> Array:
    """How far (T - 1,) any point of one arm or its load goes at most between samples."""
    if not np.ptp(samples[:, arm.slice], axis=0).any():
        return np.zeros(len(samples) - 1)
    q = samples[:, : len(scene.robot.description.joint_names)]
    poses = scene.robot.link_poses(q, (*arm.segment_ends, arm.tool_link))
    poses[:, -1] = compose(poses[:, -1], arm.tool_in_link)
    shifts = np.linalg.norm(np.diff(poses[..., :3], axis=0), axis=-1)
    cosines = np.abs(np.sum(poses[1:, :, 3:] * poses[:-1, :, 3:], axis=-1))
    angles = 2 * np.arccos(np.minimum(cosines, 1.0))
    beyond = [*len(arm.segment_ends) * [arm.segment_radius], reach]
    return np.asarray((shifts + angles * beyond).max(axis=1))


def _at_steps(samples: Array, ways: Array, step: float) -> Array:
    """The polyline (T, d) anew, at equal steps of at most ``step`` along ways (T - 1,)."""
    way = np.r_[0.0, np.cumsum(ways)]
    marks = np.linspace(0.0, way[-1], int(np.ceil(way[-1] / step)) + 1)
    if len(samples) == 1:
        return samples
    at = np.clip(np.searchsorted(way, marks, side="right") - 1, 0, len(way) - 2)
    gap = way[at + 1] - way[at]
    gap[gap == 0.0] = 1.0  # at the very end alone
    slope = (samples[at + 1] - samples[at]) / gap[:, None]
    fine: Array = slope * (marks - way[at])[:, None] + samples[at]
    fine[0], fine[-1] = samples[0], samples[-1]
    return fine
