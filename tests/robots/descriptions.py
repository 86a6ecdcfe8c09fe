"""Arms of the installed package ``example-robot-data``, for tests of what is derived from them."""

import os
import tempfile
from dataclasses import dataclass
from functools import cache
from importlib.metadata import files
from pathlib import Path

import numpy as np
import pinocchio as pin

from guided_lgp.robots.chain import Array, Chain, path_between, read_chain, read_joints


def description(file: str) -> Path:
    """A file of the package, by the end of its path."""
    for found in files("example-robot-data") or []:
        if found.as_posix().endswith("/robots/" + file):
            return Path(os.fspath(found.locate())).resolve()
    raise FileNotFoundError(file)


@cache
def plain(file: str) -> Path:
    """A copy of a URDF in which the paths of meshes are plain."""
    source = description(file)
    share = next(p for p in source.parents if p.name == "example-robot-data").parent
    text = source.read_text(encoding="utf-8").replace("package://", f"{share}/")
    copy = Path(tempfile.mkdtemp()) / source.name
    copy.write_text(text, encoding="utf-8")
    return copy


@dataclass(frozen=True)
class ArmDescription:
    """An arm by its URDF, the links at its ends and its redundant joint."""

    file: str
    root: str
    tip: str
    redundant: int | None

    @property
    def urdf(self) -> Path:
        return plain(self.file)

    @property
    def joints(self) -> list[str]:
        path = path_between(read_joints(self.urdf), self.root, self.tip)
        return [joint.name for joint in path if joint.kind in ("revolute", "continuous")]

    @property
    def chain(self) -> Chain:
        return read_chain(self.urdf, self.root, self.tip, self.joints)

    def limits(self) -> Array:
        """(n, 2) rad, by pinocchio; a turn to both sides for joints without limits."""
        model = pin.buildModelFromUrdf(str(self.urdf))
        limits = []
        for name in self.joints:
            joint = model.joints[model.getJointId(name)]
            low, high = model.lowerPositionLimit, model.upperPositionLimit
            endless = joint.nq == 2
            limits.append((-np.pi, np.pi) if endless else (low[joint.idx_q], high[joint.idx_q]))
        return np.array(limits)


ARMS = {
    "pr2, left": ArmDescription(
        "pr2_description/urdf/pr2.urdf", "base_footprint", "l_gripper_tool_frame", 0
    ),
    "pr2, right": ArmDescription(
        "pr2_description/urdf/pr2.urdf", "base_footprint", "r_gripper_tool_frame", 0
    ),
    "panda": ArmDescription(
        "panda_description/urdf/panda.urdf", "panda_link0", "panda_hand_tcp", 6
    ),
    "ur5": ArmDescription("ur_description/urdf/ur5_gripper.urdf", "base_link", "tool0", None),
    "z1": ArmDescription("z1_description/urdf/z1.urdf", "link00", "link06", None),
    "xarm7": ArmDescription("xarm_description/urdf/xarm7.urdf", "link_base", "link_eef", 6),
    "tiago": ArmDescription(
        "tiago_description/robots/tiago.urdf", "base_footprint", "arm_tool_link", 0
    ),
    "baxter": ArmDescription(
        "baxter_description/urdf/baxter.urdf", "base", "left_gripper_base_link", 0
    ),
}
"""All have a structure that is solved in closed form; Baxter's wrist is a centimetre off."""

TIAGO_PRO = ArmDescription(
    "tiago_pro_description/robots/tiago_pro.urdf", "base_footprint", "arm_right_tool_link", 0
)
"""Has none."""
