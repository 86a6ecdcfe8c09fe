"""The robot: where its links are, and what its joints may do."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from plan_checker.document import ROUNDING, SHARE, Fault, Plan
from plan_checker.geometry import box_corners, planar_pose


class Robot:
    """The robot of the plan: limits, hulls of its links, and where they are.

    A link may have several hulls, each with a name of its own; ``link`` has the link of each.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.model = pin.buildModelFromUrdf(str(plan.urdf))
        self.geometry = pin.buildGeomFromUrdf(
            self.model, str(plan.urdf), pin.GeometryType.COLLISION, package_dirs=[str(SHARE)]
        )
        items = self.geometry.geometryObjects
        self.hulls = {item.name: _vertices(item) for item in items}
        self.link = {item.name: self.model.frames[item.parentFrame].name for item in items}
        self.fixed = {item.name for item in items if item.parentJoint == 0}
        self.base = planar_pose(*plan.base)
        self.base[:3, :3] @= Rotation.from_euler("xy", plan.tilt).as_matrix()

    def hull_names(self, links: Iterable[str]) -> list[str]:
        """The hulls of links."""
        return [name for wanted in links for name, link in self.link.items() if link == wanted]

    def unknown(self) -> Iterator[Fault]:
        for name in [*self.plan.joints, *self.plan.fixed]:
            if not self.model.existJointName(name):
                yield Fault("format", None, f"the robot has no joint {name}")
        for gripper in {attachment.gripper for attachment in self.plan.attachments}:
            for finger in self.plan.hands[gripper].fingers:
                if finger not in self.plan.joints:
                    yield Fault("format", None, f"{finger} is not in joint_names")

    def joint(self, name: str) -> Any:
        return self.model.joints[self.model.getJointId(name)]

    def limits(self, name: str) -> tuple[float, float]:
        """Lower and upper limit; none if the joint turns freely."""
        joint = self.joint(name)
        if joint.nq > joint.nv:
            return -np.inf, np.inf
        model = self.model
        return model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]

    def forward(self, rows: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Poses (n, 4, 4) of the links that have a hull, and of the grippers' tool frames."""
        model, geometry = self.model, self.geometry
        data, placed = model.createData(), geometry.createData()
        hands = self.plan.hands.values()
        tools = [(model.getFrameId(hand.tool), hand.frame) for hand in hands]
        links = np.empty((len(self.hulls), len(rows), 4, 4))
        grips = np.empty((len(tools), len(rows), 4, 4))
        names = [*self.plan.fixed, *self.plan.joints]
        values = np.hstack([np.tile(list(self.plan.fixed.values()), (len(rows), 1)), rows])
        configurations = np.tile(pin.neutral(model), (len(rows), 1))
        for name, value in zip(names, values.T, strict=True):
            joint = self.joint(name)
            if joint.nq > joint.nv:
                configurations[:, joint.idx_q] = np.cos(value)
                configurations[:, joint.idx_q + 1] = np.sin(value)
            else:
                configurations[:, joint.idx_q] = value
        for row, configuration in enumerate(configurations):
            pin.forwardKinematics(model, data, configuration)
            pin.updateGeometryPlacements(model, data, geometry, placed)
            for index, pose in enumerate(placed.oMg):
                links[index, row] = pose.homogeneous
            for index, (link, frame) in enumerate(tools):
                placement = pin.updateFramePlacement(model, data, link)
                grips[index, row] = placement.homogeneous @ frame
        links, grips = self.base @ links, self.base @ grips
        return (
            dict(zip(self.hulls, links, strict=True)),
            dict(zip(self.plan.hands, grips, strict=True)),
        )


def _vertices(item: Any) -> np.ndarray:
    shape = item.geometry
    if hasattr(shape, "halfSide"):
        return box_corners(2 * shape.halfSide)
    if hasattr(shape, "radius"):
        return _round(
            shape.radius, getattr(shape, "halfLength", 0.0), isinstance(shape, coal.Cylinder)
        )
    mesh = np.array([shape.vertex(index) for index in range(shape.num_vertices)])
    return mesh[ConvexHull(mesh).vertices]


def _round(radius: float, half_length: float, flat: bool) -> np.ndarray:
    """Vertices on a cylinder along z, or (not ``flat``) a capsule or sphere; faces 1 % inside."""
    around = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    up = np.zeros(1) if flat else np.linspace(0, np.pi / 2, 9)
    rings = radius * np.stack(
        [
            np.outer(np.cos(up), np.cos(around)),
            np.outer(np.cos(up), np.sin(around)),
            np.repeat(np.sin(up)[:, None], len(around), axis=1),
        ],
        axis=-1,
    )
    upper = rings.reshape(-1, 3) + np.array([0, 0, half_length])
    return np.vstack([upper, upper * (1, 1, -1)])


def wrong_start(plan: Plan) -> Iterator[Fault]:
    for name, value in plan.start.items():
        found = plan.q[0, plan.joints.index(name)]
        if abs(found - value) > ROUNDING:
            yield Fault("start", 0, f"{name} starts at {found:.3f}, in the scene at {value:.3f}")


def broken_limits(plan: Plan, robot: Robot) -> Iterator[Fault]:
    fixed = [(name, np.array([value])) for name, value in plan.fixed.items()]
    for name, values in [*fixed, *zip(plan.joints, plan.q.T, strict=True)]:
        lower, upper = robot.limits(name)
        beyond = np.maximum(lower - values, values - upper)
        row = int(beyond.argmax())
        if beyond[row] > ROUNDING:
            text = f"{name} = {values[row]:.3f}, limits {lower:.3f} to {upper:.3f}"
            yield Fault("limit", row, text)


def broken_velocities(plan: Plan, robot: Robot) -> Iterator[Fault]:
    speeds = np.abs(np.diff(plan.q, axis=0)) / np.diff(plan.times)[:, None]
    for name, speed in zip(plan.joints, speeds.T, strict=True):
        limit = robot.model.velocityLimit[robot.joint(name).idx_v]
        interval = int(speed.argmax())
        if speed[interval] > limit * (1 + ROUNDING):
            text = f"{name} moves at {speed[interval]:.2f} rad/s, limit {limit:.2f}"
            yield Fault("velocity", interval, text)


def broken_mimics(plan: Plan) -> Iterator[Fault]:
    """The fingers of a gripper are driven by one motor."""
    column = plan.fixed | dict(zip(plan.joints, plan.q.T, strict=True))
    for joint in ET.parse(plan.urdf).getroot().iter("joint"):
        mimic, name = joint.find("mimic"), joint.get("name", "")
        if mimic is None or name not in plan.joints:
            continue
        leader = column.get(mimic.get("joint", ""), 0.0)
        expected = float(mimic.get("multiplier", 1)) * leader + float(mimic.get("offset", 0))
        apart = np.abs(column[name] - expected)
        if apart.max() > ROUNDING:
            text = f"{name} does not follow {mimic.get('joint')}"
            yield Fault("mimic", int(apart.argmax()), text)
