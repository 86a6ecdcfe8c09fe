"""Inverse kinematics: of any arm of six or seven joints, and in closed form of one kind of arm."""

from guided_lgp.robots.inverse.general import InverseKinematics, inverse_kinematics
from guided_lgp.robots.inverse.human_like import HumanLike, lengths_of
from guided_lgp.robots.inverse.offset_shoulder import OffsetShoulder

__all__ = ["HumanLike", "InverseKinematics", "OffsetShoulder", "inverse_kinematics", "lengths_of"]
