"""Starts of the solver: placements drawn on their supports, grasps by closed-form kinematics.

A start chooses, action by action, where boxes are put down and, for each mode of a box in a
gripper, one pitch for which all its configurations have an inverse kinematic solution within the
joint limits. That is most of the work: the solver only has to make it collision-free and exact.
"""

import numpy as np

from guided_lgp.bounds.coarse.formulation import (
    SIDES,
    Formulation,
    Leg,
    Level,
    Mode,
    Placement,
    Posture,
    SceneGeometry,
    Separation,
)
from guided_lgp.bounds.coarse.solver import Solver
from guided_lgp.bounds.results import Array
from guided_lgp.scene import pr2

_PANS = np.linspace(-0.65, 1.6, 10)
"""Shoulder pans (rad) that are tried, left arm."""
_PITCHES = np.pi * np.array([0.2, 0.35, 0.5, 0.65, 0.8])
"""Pitches (rad) of the approach that are tried, from one end of the box over the top."""
_PLACEMENTS = 6
"""Placements drawn, of which the best to reach is taken."""
_LIMITS = pr2.JOINT_LIMITS[:7]
_HOME = pr2.HOME["pr2L"]


class Starts:
    """Draws starts for one formulation."""

    def __init__(self, geometry: SceneGeometry, solver: Solver) -> None:
        self._geometry = geometry
        self._solver = solver
        self._torso = geometry.scene.robot.torso

    def draw(
        self,
        formulation: Formulation,
        generator: np.random.Generator,
        noise: float,
        known: Array | None = None,
    ) -> Array:
        """A start.

        Args:
            formulation: the program.
            generator: for placements and choices.
            noise: how far from the best candidates the choice may be (0: the best ones).
            known: values of the first variables, which are kept.

        Returns:
            values of the variables, then the constants.
        """
        values = np.concatenate([formulation.program.target, formulation.constants])
        fixed = 0 if known is None else len(known)
        if known is not None:
            values[:fixed] = known
        reach = _Reach(self._solver, self._torso)
        _Draft(reach, formulation, generator, noise, values, fixed).fill()
        return values


class _Draft:
    """One start in the making."""

    def __init__(
        self,
        reach: "_Reach",
        formulation: Formulation,
        generator: np.random.Generator,
        noise: float,
        values: Array,
        fixed: int,
    ) -> None:
        self._reach = reach
        self._generator = generator
        self._noise = noise
        self._values = values
        self._fixed = fixed
        self._modes = {id(posture): mode for mode in formulation.modes for posture in mode.postures}
        self._mode_of = {
            (mode.box, posture.action): mode
            for mode in formulation.modes
            for posture in mode.postures
        }
        self._formulation = formulation

    def fill(self) -> None:
        """Give every variable that is not known a value."""
        for step in self._formulation.steps:
            for item in step:
                if isinstance(item, Placement):
                    self._place(item)
                elif isinstance(item, Posture) and item.free:
                    self._offer(item)
                elif isinstance(item, Separation) and item.angle >= self._fixed:
                    self._values[item.angle] = self._separating(item)
        for mode in self._formulation.modes:
            self._hold(mode)

    def pose(self, level: Level) -> Array:
        """x, y, yaw and z of a level body."""
        return np.array(self._formulation.level(self._values, level))

    def _place(self, item: Placement) -> None:
        if item.level.x < self._fixed:
            return
        support = self.pose(item.support)
        count = _PLACEMENTS
        local = self._generator.uniform(-1, 1, (count, 2)) * np.array(item.half)
        cosine, sine = np.cos(support[2]), np.sin(support[2])
        candidates = np.empty((count, 4))
        candidates[:, 0] = support[0] + cosine * local[:, 0] - sine * local[:, 1]
        candidates[:, 1] = support[1] + sine * local[:, 0] + cosine * local[:, 1]
        candidates[:, 2] = self._generator.uniform(-np.pi / 2, np.pi / 2, count)
        candidates[:, 3] = support[3] + item.level.offset - item.support.offset
        overlap = self._overlaps(item, candidates)
        mode = self._mode_of[item.box, item.action]
        origin = self.pose(mode.postures[0].level)
        pitches = self._pitches(mode)
        grasp = self._costs(mode, origin[None], mode.postures[0].legs, pitches)
        place = self._costs(mode, candidates, self._legs_of(mode, item.action), pitches)
        total = (grasp + place).min(axis=1) + overlap
        best = self._choose(total)
        for slot, value in zip(item.level.plane, candidates[best], strict=False):
            self._values[slot] = value
        for before, after in item.carried:
            self._carry(self.pose(item.old), self.pose(before), self.pose(item.level), after)

    def _legs_of(self, mode: Mode, action: int) -> tuple[Leg, ...]:
        """The straight segments of the last posture of an action."""
        return next(p.legs for p in reversed(mode.postures) if p.action == action)

    def _carry(self, old: Array, before: Array, new: Array, after: Level) -> None:
        turn = new[2] - old[2]
        cosine, sine = np.cos(turn), np.sin(turn)
        dx, dy = before[0] - old[0], before[1] - old[1]
        self._values[after.x] = new[0] + cosine * dx - sine * dy
        self._values[after.y] = new[1] + sine * dx + cosine * dy
        self._values[after.yaw] = before[2] + turn

    def _overlaps(self, item: Placement, candidates: Array) -> Array:
        """How much (m) each candidate overlaps what is beside it."""
        total = np.zeros(len(candidates))
        for other in self._formulation.steps[item.action]:
            if isinstance(other, Separation) and other.first is item.level:
                total += np.array(
                    [
                        max(0.0, -_separation(c, self.pose(other.second), other.halves)[0])
                        for c in candidates
                    ]
                )
        return 20 * total

    def _separating(self, item: Separation) -> float:
        return _separation(self.pose(item.first), self.pose(item.second), item.halves)[1]

    def _offer(self, item: Posture) -> None:
        if item.level.x < self._fixed:
            return
        count = _PLACEMENTS
        mode = self._modes[id(item)]
        candidates = np.empty((count, 4))
        candidates[:, 0] = self._generator.uniform(0.4, 0.65, count)
        candidates[:, 1] = self._generator.uniform(-0.15, 0.25, count) * SIDES[mode.gripper]
        candidates[:, 2] = self._generator.uniform(-np.pi / 2, np.pi / 2, count)
        lowest = self._formulation.program.lower[item.level.z]
        candidates[:, 3] = lowest + self._generator.uniform(0.0, 0.1, count)
        pitches = self._pitches(mode)
        first = mode.postures[0]
        grasp = self._costs(mode, self.pose(first.level)[None], first.legs, pitches)
        total = (grasp + self._costs(mode, candidates, (), pitches)).min(axis=1)
        best = self._choose(total)
        for slot, value in zip((*item.level.plane, item.level.z), candidates[best], strict=True):
            self._values[slot] = value

    def _pitches(self, mode: Mode) -> Array:
        if mode.pitch < self._fixed:
            return self._values[[mode.pitch]]
        return _PITCHES

    def _hold(self, mode: Mode) -> None:
        """Choose one pitch for a mode and the joints of its postures."""
        if all(posture.joints[0] < self._fixed for posture in mode.postures):
            return
        poses = [self.pose(posture.level) for posture in mode.postures]
        pitches = self._pitches(mode)
        if mode.pitch >= self._fixed:
            pitches = pitches + self._noise * self._generator.uniform(-0.4, 0.4)
            costs = sum(
                self._costs(mode, pose[None], posture.legs, pitches)[0]
                for posture, pose in zip(mode.postures, poses, strict=True)
            )
            pitches = pitches[[self._choose(np.asarray(costs))]]
            self._values[mode.pitch] = pitches[0]
        for posture, pose in zip(mode.postures, poses, strict=True):
            if posture.joints[0] >= self._fixed:
                joints, costs = self._solutions(mode, pose[None], posture.legs, pitches)
                chosen = self._choose(costs[0, 0])
                ends = (posture.joints, *(leg.joints for leg in posture.legs))
                for slots, values in zip(ends, joints[0, 0, :, chosen], strict=True):
                    self._values[list(slots)] = values

    def _choose(self, costs: Array) -> int:
        if self._noise:
            costs = costs + self._noise * self._generator.exponential(1.0, costs.shape)
        return int(np.argmin(costs))

    def _costs(self, mode: Mode, poses: Array, legs: tuple[Leg, ...], pitches: Array) -> Array:
        """Least cost (len(poses), len(pitches)) over the shoulder's pan."""
        return np.asarray(self._solutions(mode, poses, legs, pitches)[1].min(axis=2))

    def _solutions(
        self, mode: Mode, poses: Array, legs: tuple[Leg, ...], pitches: Array
    ) -> tuple[Array, Array]:
        return self._reach.solve(mode, float(self._values[mode.offset]), poses, legs, pitches)


class _Reach:
    """Closed-form inverse kinematics over a grid of poses, pitches and shoulder pans."""

    def __init__(self, solver: Solver, torso: float) -> None:
        self._solver = solver
        self._torso = torso

    def solve(
        self, mode: Mode, offset: float, poses: Array, legs: tuple[Leg, ...], pitches: Array
    ) -> tuple[Array, Array]:
        """Inverse kinematics of a contact and the ends of its legs.

        Returns:
            joints (poses, pitches, 1 + legs, pans, 7) and costs (poses, pitches, pans): what is
            missing to reach and beyond the joint limits, and some motion from the arm's side.
        """
        ends = np.array([(0.0, 0.0), *((leg.back, leg.up) for leg in legs)])
        shape = (len(poses), len(pitches), len(ends), 2 * len(_PANS))
        arguments = np.empty((*shape, 15))
        arguments[..., :4] = poses[:, None, None, None]
        arguments[..., 4] = pitches[:, None, None]
        arguments[..., 5] = offset
        arguments[..., 6] = np.tile(_PANS, 2)
        arguments[..., 7] = np.repeat([1.0, -1.0], len(_PANS))
        arguments[..., 8] = SIDES[mode.gripper]
        arguments[..., 9] = self._torso
        arguments[..., 10] = ends[:, 1, None]
        arguments[..., 11:14] = mode.half_length, mode.half_height, mode.turn
        arguments[..., 14] = ends[:, 0, None]
        solutions = self._solver.reach(arguments.reshape(-1, 15)).reshape(*shape, 8)
        joints = solutions[..., :7]
        beyond = np.maximum(_LIMITS[:, 0] - joints, 0) + np.maximum(joints - _LIMITS[:, 1], 0)
        motion = ((joints - _HOME) ** 2)[..., :4].sum(axis=-1)
        costs = 5 * beyond.sum(axis=-1) + 20 * solutions[..., 7] + 0.05 * motion
        return np.clip(joints, _LIMITS[:, 0], _LIMITS[:, 1]), costs.sum(axis=2)


def _separation(
    first: Array, second: Array, halves: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Largest distance (m) along the boxes' axes that separates them, and that direction (rad)."""
    angles = np.concatenate([first[2] + _QUARTERS, second[2] + _QUARTERS])
    normals = np.stack([np.cos(angles), np.sin(angles)])
    distance = (second[:2] - first[:2]) @ normals
    for yaw, (hx, hy) in ((first[2], halves[:2]), (second[2], halves[2:])):
        distance = distance - hx * np.abs(np.cos(angles - yaw)) - hy * np.abs(np.sin(angles - yaw))
    best = int(np.argmax(distance))
    return float(distance[best]), float(angles[best])


_QUARTERS = np.arange(4) * np.pi / 2
