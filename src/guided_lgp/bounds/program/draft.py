"""A start in the making: values that are kept from before, and values that terms choose."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from guided_lgp.bounds.program.inverse import StartIk
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.program.slots import ArmConfiguration, HeldBox, PlanarPose
from guided_lgp.bounds.results import Array


class Draft:
    """One start in the making."""

    def __init__(
        self,
        values: Array,
        variables: int,
        lower: Array,
        kept: int,
        random: Callable[[], np.random.Generator],
        noise: float,
        configurations: Mapping[HeldBox, Sequence[ArmConfiguration]],
        robot: RobotKinematics,
        ik: Mapping[str, StartIk],
    ) -> None:
        """Begin a start.

        Args:
            values: of the variables, then the constants; filled in place.
            variables: their number.
            lower: bounds of the variables.
            kept: how many values, the first ones, are known and stay.
            random: the generator for placements and choices, always the same one.
            noise: how far from the best candidates a choice may be (0: the best ones).
            configurations: of each grip.
            robot: whose arms these are.
            ik: inverse kinematics of its arms, by gripper.
        """
        self.values = values
        self.lower = lower
        self.kept = kept
        self._random = random
        self.noise = noise
        self.configurations = configurations
        self.robot = robot
        self.ik = ik
        self._variables = variables

    @property
    def generator(self) -> np.random.Generator:
        """For placements and choices."""
        return self._random()

    def pose(self, pose: PlanarPose) -> Array:
        """x, y, yaw and z of a level body."""
        return np.array(self.place(pose))

    def place(self, pose: PlanarPose) -> tuple[float, float, float, float]:
        """The same in plain numbers."""
        return pose_values(self.values, self._variables, pose)

    def choose(self, costs: Array) -> int:
        """The index of the least cost (C,), or of another low one."""
        return int((costs + self.extra(len(costs))).argmin())

    def extra(self, count: int) -> Array:
        """What so many candidates cost besides, so that others than the best are chosen, too."""
        if self.noise:
            return self.noise * self.generator.exponential(1.0, count)
        return np.zeros(count)


def pose_values(
    values: Array, variables: int, pose: PlanarPose
) -> tuple[float, float, float, float]:
    """x, y, yaw and z of a level body.

    Args:
        values: of the variables, then the constants.
        variables: their number.
        pose: slots.
    """
    slots = (pose.x, pose.y, pose.yaw, pose.z)
    x, y, yaw, z = [values.item(s if s >= 0 else variables - 1 - s) for s in slots]
    return x, y, yaw, z + pose.offset
