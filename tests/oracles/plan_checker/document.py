"""A plan file as it is read."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from plan_checker.geometry import box_corners, planar_pose

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
DESCRIPTIONS = SHARE / "example-robot-data" / "robots"
ROBOTS = Path(__file__).parents[3] / "src" / "guided_lgp" / "robots"
AXES = {
    f"{sign}{axis}": row
    for sign, rows in (("", np.eye(3)), ("-", -np.eye(3)))
    for axis, row in zip("xyz", rows, strict=True)
}
TABLE_THICKNESS = 0.03  # a scene gives the top alone; below a slab, links are free to pass
ROUND = 60  # sides of the prism that stands for a cylinder
SAME_POSITION, SAME_ANGLE = 1e-3, 1e-2  # keyframes and path tell the same
ROUNDING = 1e-3  # relative in velocities, absolute in joint positions
Kind = (
    Literal["format", "logic", "attachment", "order", "keyframe", "goal", "start"]
    | Literal["limit", "velocity", "mimic", "grasp", "fingers", "support", "collision"]
)


class Fault(NamedTuple):
    """What is wrong, at which row of the path (None: not tied to one), in words."""

    kind: Kind
    row: int | None
    text: str


class Attachment(NamedTuple):
    box: str
    gripper: str
    start: int
    end: int


class Keyframe(NamedTuple):
    q: np.ndarray  # (joints,)
    boxes: dict[str, tuple[np.ndarray, float]]  # position and yaw


class Hand(NamedTuple):
    """What the robot file says of a gripper."""

    joints: list[str]  # of its arm, from the shoulder on
    tool: str  # link
    frame: np.ndarray  # (4, 4) of the tool frame in it: x out of the palm, fingers close along y
    links: list[str]  # the palm first
    fingers: list[str]  # joints; the others follow the first


@dataclass(frozen=True)
class Plan:
    hands: dict[str, Hand]
    urdf: Path
    srdf: Path | None
    stand: tuple[float, float]  # half extents of the column under a raised base
    boxes: dict[str, dict[str, Any]]  # what may be moved
    tables: dict[str, dict[str, Any]]  # what may be stood on and is not moved
    obstacles: dict[str, dict[str, Any]]
    base: tuple[float, float, float, float]  # x, y, height, yaw
    tilt: tuple[float, float]  # roll and pitch before that yaw; a base that is tilted has no column
    goals: list[tuple[str, ...]]
    actions: list[tuple[str, ...]]
    joints: list[str]
    fixed: dict[str, float]
    start: dict[str, float]  # where the scene has joints at first, if not at home
    times: np.ndarray  # (n,)
    q: np.ndarray  # (n, joints)
    attachments: list[Attachment]
    keyframes: list[Keyframe]

    @property
    def column(self) -> bool:
        return self.base[2] > 0 and not any(self.tilt)


class Motion(NamedTuple):
    """Poses (n, 4, 4) by name at every row: hulls of links, tool frames by gripper, boxes."""

    links: dict[str, np.ndarray]
    tools: dict[str, np.ndarray]
    boxes: dict[str, np.ndarray]


GOALS = {
    "held": (1,),
    "on": (2,),
    "heldby": (2,),
    "empty": (1,),
    "handempty": (0,),
    "at": (6, 7, 8),  # box, table, x, y, z, yaw and, if not the usual ones, tolerances in m and rad
    "in": (6,),  # box, table, two corners of a rectangle in the frame of its top
    "upright": (1,),
    "posture": range(2, 20),  # gripper, and a value for every joint of its arm
}
ACTIONS = {"grasp": (2,), "place": (3,), "take": (3,)}
NEAR, TURNED = 0.01, 0.05  # the usual tolerances of a goal's pose
EDGE = 5e-4  # a corner may be outside a goal's region by this much


def _atom(text: str, arities: Mapping[str, Sequence[int]]) -> tuple[str, ...]:
    found = re.fullmatch(r"\((\w+)((?: \S+)*)\)", text)
    words = (found[1], *found[2].split()) if found else ("",)
    if len(words) - 1 not in arities.get(words[0], ()):
        raise ValueError(f"{text!r} is none of {', '.join(arities)}")
    return words


def read_plan(document: Mapping[str, Any]) -> Plan:
    scene, path = document["scene"], document["path"]
    placed = scene["robot"]
    x, y, yaw = map(float, placed["base"])
    robot = _robot_file(placed["model"])
    plan = Plan(
        hands={name: _hand(arm) for name, arm in robot["arms"].items()},
        urdf=robot["description"]["urdf"],
        srdf=robot["description"].get("srdf"),
        stand=tuple(robot.get("stand", (0.1, 0.1))),
        boxes={box["name"]: box for box in scene["boxes"] if not box.get("fixed")},
        tables={
            body["name"]: body
            for body in [*scene["tables"], *(box for box in scene["boxes"] if box.get("fixed"))]
        },
        obstacles={body["name"]: body for body in scene.get("obstacles", [])},
        base=(x, y, float(placed.get("height", 0.0)), yaw),
        tilt=tuple(map(float, placed.get("tilt", (0.0, 0.0)))),
        goals=[_atom(goal, GOALS) for goal in document["objective"]],
        actions=[_atom(action, ACTIONS) for action in document["actions"]],
        joints=list(document["joint_names"]),
        fixed={name: float(value) for name, value in document["fixed_joints"].items()},
        start={name: float(value) for name, value in placed.get("joints", {}).items()},
        times=np.array(path["times"], float),
        q=np.array(path["q"], float),
        attachments=_merged(
            Attachment(a["box"], a["gripper"], int(a["start"]), int(a["end"]))
            for a in path["attachments"]
        ),
        keyframes=[
            Keyframe(
                np.array(keyframe["q"], float),
                {
                    name: (np.array(pose["position"], float), float(pose["yaw"]))
                    for name, pose in keyframe["boxes"].items()
                },
            )
            for keyframe in document["keyframes"]
        ],
    )
    rows = len(plan.times)
    if plan.q.shape != (rows, len(plan.joints)) or rows < 2:
        raise ValueError(f"path.q has shape {plan.q.shape} for {rows} times")
    if not (np.isfinite(plan.q).all() and np.isfinite(plan.times).all()):
        raise ValueError("path: a number is not finite")
    if (np.diff(plan.times) <= 0).any():
        raise ValueError("path.times do not increase")
    if len(set(plan.joints)) < len(plan.joints) or set(plan.joints) & set(plan.fixed):
        raise ValueError("a joint is listed twice")
    for name, joint in robot.get("fixed_joints", {}).items():
        if plan.fixed.get(joint["joint"]) != float(placed[name]):
            raise ValueError(f"{joint['joint']} is not at the scene's {name}")
    grounded = {*plan.tables, *plan.hands}
    for _ in plan.boxes:
        grounded |= {name for name, box in plan.boxes.items() if box["on"] in grounded}
    if not plan.boxes.keys() <= grounded:
        raise ValueError("a box of the scene stands on nothing")
    for box, gripper, start, end in plan.attachments:
        if box not in plan.boxes or gripper not in plan.hands or not 0 <= start < end < rows:
            raise ValueError(f"no such attachment: {box} {gripper} {start} {end}")
    if len(plan.keyframes) != len(plan.actions):
        raise ValueError(f"{len(plan.keyframes)} keyframes for {len(plan.actions)} actions")
    for keyframe in plan.keyframes:
        if keyframe.q.shape != plan.q[0].shape or keyframe.boxes.keys() != plan.boxes.keys():
            raise ValueError("a keyframe lacks a joint or a box")
    return plan


def _robot_file(model: str) -> dict[str, Any]:
    """A robot file with the arms that mirror others written out, and its files found."""
    file = ROBOTS / f"{model}.yaml" if (ROBOTS / f"{model}.yaml").is_file() else Path(model)
    robot: dict[str, Any] = yaml.safe_load(file.read_text(encoding="utf-8"))
    arms = robot["arms"]
    whole = {
        name: arms[arm["mirrors"]] | arm if "mirrors" in arm else arm for name, arm in arms.items()
    }
    robot["arms"] = {
        name: json.loads(json.dumps(arm).replace("<side>", arm.get("side", "")))
        for name, arm in whole.items()
    }
    description = robot["description"]
    folder = DESCRIPTIONS if "package" in description else file.parent
    for key in {"urdf", "srdf"} & description.keys():
        description[key] = folder / description[key]
    return robot


def _hand(arm: Mapping[str, Any]) -> Hand:
    tool, frame = arm["tool"], np.eye(4)
    x, y = AXES[tool["approach"]], AXES[tool["closing"]]
    frame[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
    frame[:3, 3] = tool.get("offset", (0, 0, 0))
    return Hand(
        arm["joints"],
        tool["link"],
        frame,
        arm["hand_links"],
        arm.get("fingers", {}).get("joints", []),
    )


def _merged(attachments: Iterable[Attachment]) -> list[Attachment]:
    """In order of their starts; one that goes on where another of the same pair ends, joined."""
    result: list[Attachment] = []
    for new in sorted(attachments, key=lambda a: (a.box, a.start)):
        if result and result[-1][:2] == new[:2] and result[-1].end == new.start:
            result[-1] = result[-1]._replace(end=new.end)
        else:
            result.append(new)
    return sorted(result, key=lambda a: (a.start, a.box))


def scene_pose(plan: Plan, name: str) -> np.ndarray:
    """The centre of a body, or the centre of the top of a table."""
    item = (plan.boxes | plan.tables | plan.obstacles)[name]
    pose = planar_pose(*item["position"], item.get("yaw", 0.0))
    if "quaternion" in item:
        pose[:3, :3] = Rotation.from_quat(item["quaternion"]).as_matrix()
    return pose


def body_vertices(item: Mapping[str, Any]) -> np.ndarray:
    """Vertices (n, 3) of a body about its pose; of a cylinder, those of a prism around it."""
    if "half_extents" in item:
        x, y = item["half_extents"]
        return box_corners((2 * x, 2 * y, TABLE_THICKNESS)) - (0, 0, TABLE_THICKNESS / 2)
    if item.get("shape") == "mesh":
        return np.array(item["vertices"], float)
    if item.get("shape") == "cylinder":
        angles = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
        radius = item["size"][0] / 2 / np.cos(np.pi / ROUND)
        ring = [(radius * np.cos(angle), radius * np.sin(angle)) for angle in angles]
        return np.array([(x, y, z * item["size"][2] / 2) for x, y in ring for z in (-1, 1)])
    return box_corners(item["size"])
