"""Limits of joints, as a URDF states them."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guided_lgp.errors import InputError


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint in rad or m, and in rad/s or m/s."""

    lower: float
    upper: float
    velocity: float
    continuous: bool
    """Turns without end: its limits are infinite."""


def read_limits(urdf: Path, soft: bool = True) -> dict[str, JointLimits]:
    """Limits of all joints that can move, by name.

    Args:
        urdf: the description's file.
        soft: use the limits of the safety controller where they are narrower, inside which a
            real arm keeps.
    """
    joints = ET.parse(urdf).getroot().findall("joint")
    moving = (joint for joint in joints if joint.get("type") not in ("fixed", "floating", "planar"))
    return {joint.get("name", ""): _limits(joint, soft) for joint in moving}


def _limits(joint: ET.Element, soft: bool) -> JointLimits:
    limit = joint.find("limit")
    stated = {} if limit is None else limit.attrib
    continuous = joint.get("type") == "continuous"
    if not continuous and not {"lower", "upper"} <= stated.keys():
        name = joint.get("name", "")
        raise InputError("robot", f"joint {name} has no limits in the URDF", "lower and upper")
    lower = -np.inf if continuous else float(stated["lower"])
    upper = np.inf if continuous else float(stated["upper"])
    safety = joint.find("safety_controller")
    if soft and safety is not None and not continuous:
        lower = max(lower, float(safety.get("soft_lower_limit", lower)))
        upper = min(upper, float(safety.get("soft_upper_limit", upper)))
    return JointLimits(lower, upper, float(stated.get("velocity", np.inf)), continuous)
