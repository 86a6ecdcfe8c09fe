"""Forward kinematics of a robot that stands somewhere."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from guided_lgp.poses import Array, compose
from guided_lgp.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class Mounted:
    """A robot where it stands."""

    robot: Robot
    base: Array
    """Pose (7,) of the base link in the world."""
    fixed: Mapping[str, float]
    """Values (rad, or m) of the joints that stay as they are."""

    def link_poses(self, q: Array, links: Sequence[str]) -> Array:
        """Poses (T, len(links), 7) of links' frames in the world.

        Args:
            q: motion (T, n) in rad.
            links: names in the URDF; the fingers are at zero.
        """
        return compose(self.base, self.robot.kinematics.link_poses(q, self.fixed, links))

    def tool_poses(self, q: Array, grippers: Sequence[str] | None = None) -> dict[str, Array]:
        """Poses (T, 7) of tool frames, by default of all, along a motion q (T, n), by gripper."""
        arms = self.robot.arms
        wanted = tuple(arms) if grippers is None else grippers
        poses = self.link_poses(q, [arms[gripper].tool_link for gripper in wanted])
        return {
            gripper: links
            if arms[gripper].tool_is_link
            else compose(links, arms[gripper].tool_in_link)
            for gripper, links in zip(wanted, poses.transpose(1, 0, 2), strict=True)
        }
