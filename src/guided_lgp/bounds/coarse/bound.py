"""The coarse bound P_coarse of a skeleton (paper, eq. 3): starts, solver, verification."""

import time
import weakref
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from guided_lgp.bounds.coarse.formulation import (
    GRASPABLE,
    SIDES,
    Formulation,
    Formulator,
    Level,
    Margins,
    Mode,
    SceneGeometry,
    Snapshot,
    UngraspableError,
    sphere_link,
)
from guided_lgp.bounds.coarse.kernels import PALM_GAP, SCALE, kernels
from guided_lgp.bounds.coarse.solver import Settings, Solution, Solver, default_solver
from guided_lgp.bounds.coarse.starts import Starts
from guided_lgp.bounds.results import Array, CoarseResult, Failure, Keyframe
from guided_lgp.bounds.verify import verify_keyframes
from guided_lgp.logic import Skeleton, format_skeleton
from guided_lgp.poses import compose, multiply, pose
from guided_lgp.scene import GRIPPERS, Scene, pr2
from guided_lgp.scene.world import World


@dataclass(frozen=True)
class CoarseSolution(CoarseResult):
    """A coarse result that remembers where its solver stopped, to start longer skeletons."""

    values: Array | None = field(default=None, compare=False, repr=False)


class CoarseBound:
    """P_coarse for the skeletons of one scene; every feasible verdict has been verified.

    A verdict depends only on the scene, the skeleton and ``restarts``: it is defined by recursion
    over the prefixes, whose constraints are a subset. A skeleton with an infeasible prefix is
    infeasible; otherwise the first start continues the solution of the prefix.
    """

    def __init__(self, scene: Scene, restarts: int, solver: Solver | None = None) -> None:
        """Prepare a scene; ``restarts`` is the number of starts before giving up."""
        self.scene = scene
        self._restarts = restarts
        self._solver = solver or default_solver()
        self._geometry = SceneGeometry(scene)
        self._starts = Starts(self._geometry, self._solver)
        self._settings = Settings()
        self._world = World(scene)
        weakref.finalize(self, self._world.close)
        self._tools = {
            gripper: pr2.tool_pose(scene, pr2.HOME_CONFIGURATION, gripper) for gripper in GRIPPERS
        }

    def solve(self, skeleton: Skeleton, prefix: CoarseResult | None = None) -> CoarseResult:
        """The verdict on a skeleton.

        Args:
            skeleton: at least one action; each applicable after those before it.
            prefix: the result of this bound for ``skeleton[:-1]``; solved first if not given.

        Raises:
            ValueError: the prefix is the result for another skeleton.
        """
        started = time.perf_counter()
        if prefix is not None and prefix.skeleton != skeleton[:-1]:
            raise ValueError("the prefix belongs to another skeleton")
        if len(skeleton) > 1 and (
            prefix is None or (prefix.feasible and not isinstance(prefix, CoarseSolution))
        ):
            prefix = self.solve(skeleton[:-1])
        if prefix is not None and not prefix.feasible:
            return CoarseResult(skeleton, feasible=False, failure=prefix.failure, restarts=0)
        result = self._search(skeleton, prefix if isinstance(prefix, CoarseSolution) else None)
        elapsed = time.perf_counter() - started
        return CoarseSolution(**(vars(result) | {"time_s": elapsed}))

    def solutions(self, skeleton: Skeleton, count: int) -> Iterator[CoarseResult]:
        """Up to ``count`` further verified solutions from independent starts."""
        programs = _Programs(self._geometry, skeleton)
        found = 0
        for attempt in range(self._restarts, self._restarts + 3 * count):
            try:
                result = self._attempt(programs, attempt, None)
            except UngraspableError:
                return
            if result.feasible:
                found += 1
                yield result
            if found == count:
                return

    def _search(self, skeleton: Skeleton, prefix: CoarseSolution | None) -> CoarseSolution:
        """Start after start until one leads to a verified solution."""
        programs = _Programs(self._geometry, skeleton)
        failures: list[Failure] = []
        for attempt in range(self._restarts):
            try:
                result = self._attempt(programs, attempt, prefix)
            except UngraspableError as error:
                failure = Failure(
                    error.action, f"width of {error.box}", error.width - GRASPABLE, "both sides"
                )
                return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=0)
            if result.feasible:
                return result
            assert result.failure is not None
            failures.append(result.failure)
        # the prefix is feasible: what fails late in the skeleton tells more
        failure = min(failures, key=lambda failure: (-failure.action, failure.violation))
        failure = replace(failure, tried=f"{self._restarts} starts of the coarse bound")
        return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=self._restarts)

    def _attempt(
        self, programs: "_Programs", attempt: int, prefix: CoarseSolution | None
    ) -> CoarseSolution:
        """One start: the first and every other one keep the solution of the prefix."""
        formulation = programs[attempt]
        known = None if prefix is None else prefix.values
        start = self._starts.draw(
            formulation,
            _generator(programs.skeleton, attempt),
            noise=0.0 if attempt == 0 else _NOISE,
            known=known if attempt == 0 or attempt % 2 else None,
        )
        solution = self._solver.solve(formulation.program, start, self._settings)
        kept = known is not None and np.array_equal(solution.values[: len(known)], known)
        verified = len(programs.skeleton) - 1 if kept else 0
        return self._check(programs.skeleton, formulation, solution, attempt + 1, verified)

    def _check(
        self,
        skeleton: Skeleton,
        formulation: Formulation,
        solution: Solution,
        restarts: int,
        verified: int,
    ) -> CoarseSolution:
        """Decode a solution and verify it, from the first action on that is not verified yet."""
        if not solution.converged(self._settings):
            failure = _worst(formulation, solution, self._settings.slack)
            return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=restarts)
        at_switch = self._keyframes(formulation, formulation.at_switch, solution.values)
        after_action = self._keyframes(formulation, formulation.after_action, solution.values)
        found = verify_keyframes(self._world, skeleton, at_switch, after_action, verified)
        if found is not None:
            failure = Failure(found.action, found.constraint, found.amount, "verification")
            return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=restarts)
        return CoarseSolution(
            skeleton,
            feasible=True,
            at_switch=at_switch,
            after_action=after_action,
            restarts=restarts,
            values=solution.values[: formulation.program.variables],
        )

    def _keyframes(
        self, formulation: Formulation, snapshots: Iterable[Snapshot], values: Array
    ) -> tuple[Keyframe, ...]:
        """Arms and boxes in the world at snapshots of the program."""
        poses: dict[int, Array] = {}
        frames = []
        for snapshot in snapshots:
            q = pr2.HOME_CONFIGURATION.copy()
            for gripper, joints in snapshot.joints.items():
                if joints is not None:
                    arm = values[list(joints)]
                    q[pr2.arm_slice(gripper)] = arm if SIDES[gripper] > 0 else pr2.MIRROR * arm
            boxes = {}
            for name, where in snapshot.boxes.items():
                if id(where) not in poses:  # most boxes stand where they stood before
                    poses[id(where)] = self._box_pose(formulation, where, values)
                boxes[name] = poses[id(where)]
            frames.append(Keyframe(q, boxes))
        return tuple(frames)

    def _box_pose(self, formulation: Formulation, where: Level | Mode, values: Array) -> Array:
        if isinstance(where, Mode):
            return compose(self._tools[where.gripper], _in_tool(where, values))
        x, y, yaw, z = formulation.level(values, where)
        return self._geometry.in_world(x, y, yaw, z)


_MARGINS = (
    Margins(),
    Margins(clear=0.0, arms=0.0, beside=0.003),
    Margins(clear=-0.004, arms=-0.01, beside=0.003),
)
"""Comfortable ones, close ones, and such that only the verification limits: starts take turns."""


class _Programs:
    """The programs of a skeleton, one per set of margins, built when a start needs them."""

    def __init__(self, geometry: SceneGeometry, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self._geometry = geometry
        self._built: dict[int, Formulation] = {}

    def __getitem__(self, attempt: int) -> Formulation:
        """The program that a start solves."""
        index = attempt % len(_MARGINS)
        if index not in self._built:
            self._built[index] = Formulator(self._geometry, _MARGINS[index]).build(self.skeleton)
        return self._built[index]


_NOISE = 0.3
"""Spread of the choices in all starts but the first."""


def _generator(skeleton: Skeleton, attempt: int) -> np.random.Generator:
    """Random numbers of one start: of the skeleton and the number of the start only."""
    return np.random.default_rng([zlib.crc32(format_skeleton(skeleton).encode()), attempt])


def _in_tool(mode: Mode, values: Array) -> Array:
    """Pose (7,) of a held box in the tool frame of its gripper."""
    pitch, offset = values[mode.pitch], values[mode.offset]
    reach = mode.half_length * abs(np.cos(pitch)) + mode.half_height * np.sin(pitch)
    level = np.array([0.0, -np.sin(pitch / 2), 0.0, np.cos(pitch / 2)])
    turned = multiply(level, pose((0, 0, 0), -mode.turn)[3:])
    return np.array([reach + pr2.PALM_FRONT + PALM_GAP, 0.0, offset, *turned])


def _worst(formulation: Formulation, solution: Solution, slack: float) -> Failure:
    """The constraint that is violated most."""
    starts = formulation.program.row_start
    excess, index, position = -np.inf, 0, 0
    for i, row in enumerate(formulation.rows):
        values = solution.residuals[starts[i] : starts[i + 1]]
        amounts = np.abs(values) if kernels()[row.kernel].equality else -values - slack
        highest = int(np.argmax(amounts))
        if amounts[highest] > excess:
            excess, index, position = float(amounts[highest]), i, highest
    row = formulation.rows[index]
    kernel = kernels()[row.kernel]
    amount = abs(float(solution.residuals[starts[index] + position]))
    names = list(row.names)
    if kernel.name in ("clear", "apart"):
        names[1] = f"{pr2.SIDE[names[1]]}_{sphere_link(position, kernel.name)}"
    scale = SCALE if position < kernel.lengths else 1.0
    return Failure(row.action, " ".join(names), amount / scale, "solver")
