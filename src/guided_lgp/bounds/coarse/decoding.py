"""From values of a program back to keyframes in the world, and to the constraint that fails."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np

from guided_lgp.bounds.coarse.compiler import kernel_shapes
from guided_lgp.bounds.coarse.formulation import Formulation
from guided_lgp.bounds.coarse.solver import Solution
from guided_lgp.bounds.program.draft import pose_values
from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.program.grasp import in_tool
from guided_lgp.bounds.program.kernels import SCALE
from guided_lgp.bounds.program.slots import HeldBox, KeyframeSlots, PlanarPose
from guided_lgp.bounds.results import Array, Failure, Keyframe
from guided_lgp.poses import compose


class Decoder:
    """Reads solutions of the programs of one scene."""

    def __init__(self, geometry: SceneGeometry) -> None:
        placed = geometry.scene.robot
        self._geometry = geometry
        self._robot = placed.description
        self._table = kernel_shapes(self._robot)
        self._equality = np.array([kernel.equality for kernel in self._table])
        self._start = placed.start
        self._tools = {
            gripper: placed.tool_pose(self._robot.home, gripper) for gripper in self._robot.grippers
        }

    def keyframes(
        self,
        formulation: Formulation,
        keyframes: Iterable[KeyframeSlots],
        values: Array,
        known: Mapping[int, Array] = MappingProxyType({}),
    ) -> tuple[Keyframe, ...]:
        """Arms and boxes in the world at keyframes of the program.

        Args:
            formulation: the program.
            keyframes: of it.
            values: of its variables, then its constants.
            known: poses of boxes, by the identity of their slots.
        """
        poses = dict(known)  # most boxes stand where they stood before
        frames = []
        for slots in keyframes:
            boxes = {}
            for name, where in slots.boxes.items():
                if id(where) not in poses:
                    poses[id(where)] = self._box_pose(formulation, where, values)
                boxes[name] = poses[id(where)]
            frames.append(Keyframe(self._configuration(slots, values), boxes))
        return tuple(frames)

    def _configuration(self, slots: KeyframeSlots, values: Array) -> Array:
        q = self._robot.home.copy()
        for gripper, joints in slots.joints.items():
            if joints is not None:
                arm = self._robot.arms[gripper]
                stays = min(joints) < 0  # constants: it holds others out as it began
                q[arm.slice] = self._start[arm.slice] if stays else arm.signs * values[list(joints)]
        return q

    def _box_pose(
        self, formulation: Formulation, where: PlanarPose | HeldBox, values: Array
    ) -> Array:
        if isinstance(where, HeldBox):
            palm_front = self._robot.arms[where.gripper].palm_front
            return compose(self._tools[where.gripper], in_tool(where, values, palm_front))
        pose = pose_values(values, formulation.program.variables, where)
        return self._geometry.in_world(*pose)

    def failure(self, formulation: Formulation, solution: Solution, slack: float) -> Failure:
        """The constraint that is violated most."""
        program, residuals = formulation.program, solution.residuals
        starts = program.starts[2]
        equality = np.repeat(self._equality[program.kernel], np.diff(starts))
        row = int(np.argmax(np.where(equality, np.abs(residuals), -residuals - slack)))
        index = int(np.searchsorted(starts, row, side="right")) - 1
        instance, own = formulation.instances[index], row - int(starts[index])
        scale = SCALE if own < self._table[instance.kernel].lengths else 1.0
        amount = abs(float(residuals[row]))
        return Failure(instance.action, instance.name(own), amount / scale, "solver")
