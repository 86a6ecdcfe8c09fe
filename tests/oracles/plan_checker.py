"""A checker of plan files, written from the description of their format alone.

It shares no code with the planner, only the robot files: kinematics by pinocchio on the URDF that
such a file names, collisions by PyBullet between the convex hulls of its meshes, each placed where
pinocchio puts it, and the boxes carried along as the attachments say. ``check(document)`` returns
the faults.

Conventions: lengths in m, angles in rad, times in s; poses are homogeneous matrices (..., 4, 4) in
the world, where the base link is at the scene's ``robot.base`` (x, y, yaw) and ``robot.height``,
turned by ``robot.tilt``. A *row* is an index into ``path.times``; *interval* i lies between rows i
and i + 1, where joints move linearly.
"""

import itertools
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
import pybullet
import yaml
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
DESCRIPTIONS = SHARE / "example-robot-data" / "robots"
ROBOTS = Path(__file__).parents[2] / "src" / "guided_lgp" / "robots"
COLUMN = "robot.column"
AXES = {
    f"{sign}{axis}": row
    for sign, rows in (("", np.eye(3)), ("-", -np.eye(3)))
    for axis, row in zip("xyz", rows, strict=True)
}

PENETRATION = 0.005  # allowed everywhere outside the declared contacts
IN_HAND = 0.015  # allowed within them: the hull of a finger fills the hollow of its inner side
STEP = 0.01  # of the fastest link point between two collision checks
ON_SUPPORT = 0.005  # a corner of a standing box may be off the plane of its support by this much
TABLE_THICKNESS = 0.03  # a scene gives the top alone; below a slab, links are free to pass
FLAT = 0.001  # vertices so near to the highest or lowest one are of one face
ROUND = 60  # sides of the prism that stands for a cylinder
HULL_MARGIN = 0.001  # by which PyBullet inflates a hull
APPROACH = 0.12  # length of the straight motion to or from a box on which fingers may touch it
AT_BOX = 0.005  # distance of a finger from the box that it holds
AWAY = 0.005  # a tool this far from where it grasped or released has left the box
OPENED = 0.002  # by which the fingers must be wider beside a box than on it, rad or m
SAME_POSITION, SAME_ANGLE = 1e-3, 1e-2  # keyframes and path tell the same
SAME_GRASP = 1e-3  # distance of a tool from where a box's own grasp has it
UPRIGHT = 0.05  # tilt (rad) up to which a box is upright on its way
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


def check(document: Mapping[str, Any]) -> list[Fault]:
    """The faults of a plan; none: anyone can carry it out and the goals hold at its end."""
    try:
        plan = _read(document)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        return [Fault("format", None, f"{type(error).__name__}: {error}")]
    robot = Robot(plan)
    faults = [*robot.unknown(), *_legal(plan)]
    if faults:
        return faults
    faults += [*_starts(plan), *_limits(plan, robot), *_velocities(plan, robot), *_mimics(plan)]
    links, tools = robot.forward(plan.q)
    motion = Motion(links, tools, _carry(plan, tools))
    try:
        events = _events(plan)
    except _UnmatchedError as unmatched:
        return [*faults, unmatched.fault]
    return [
        *faults,
        *_carriers(plan, events),
        *_standing(plan, events, motion),
        *_grasps(plan, robot, events, motion),
        *_fingers(plan, events, motion),
        *_keyframes(plan, events, motion),
        *_collisions(plan, robot, events, motion),
        *_goals(plan, events, motion),
    ]


# --- the file ------------------------------------------------------------------------------------


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


def _read(document: Mapping[str, Any]) -> Plan:
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


def _scene_pose(plan: Plan, name: str) -> np.ndarray:
    """The centre of a body, or the centre of the top of a table."""
    item = (plan.boxes | plan.tables | plan.obstacles)[name]
    pose = _planar(*item["position"], item.get("yaw", 0.0))
    if "quaternion" in item:
        pose[:3, :3] = Rotation.from_quat(item["quaternion"]).as_matrix()
    return pose


def _body(item: Mapping[str, Any]) -> np.ndarray:
    """Vertices (n, 3) of a body about its pose; of a cylinder, those of a prism around it."""
    if "half_extents" in item:
        x, y = item["half_extents"]
        return _corners((2 * x, 2 * y, TABLE_THICKNESS)) - (0, 0, TABLE_THICKNESS / 2)
    if item.get("shape") == "mesh":
        return np.array(item["vertices"], float)
    if item.get("shape") == "cylinder":
        angles = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
        radius = item["size"][0] / 2 / np.cos(np.pi / ROUND)
        ring = [(radius * np.cos(angle), radius * np.sin(angle)) for angle in angles]
        return np.array([(x, y, z * item["size"][2] / 2) for x, y in ring for z in (-1, 1)])
    return _corners(item["size"])


def _face(vertices: np.ndarray, side: Literal[-1, 1]) -> np.ndarray:
    """The vertices of a flat top (1) or base (-1)."""
    heights = side * vertices[:, 2]
    return vertices[heights > heights.max() - FLAT]


def _planar(x: float, y: float, z: float, yaw: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    pose[:3, 3] = x, y, z
    return pose


# --- the actions: legal, and told by the attachments ---------------------------------------------


@dataclass
class State:
    """Who holds what, and what stands on what."""

    support: dict[str, str]  # of every box that is not held
    holds: dict[str, str]  # gripper: box

    def chain(self, item: str) -> list[str]:
        """The item, what it stands on, and so on down."""
        down = [item]
        while down[-1] in self.support:
            down.append(self.support[down[-1]])
        return down

    def carrier(self, box: str) -> str | None:
        """The gripper that moves the box, directly or through the boxes below it."""
        root = self.chain(box)[-1]
        return next((gripper for gripper, held in self.holds.items() if held == root), None)

    def carried(self, item: str) -> list[str]:
        """The boxes that stand on the item, directly or through others."""
        return [box for box in self.support if item in self.chain(box)[1:]]

    def apply(self, action: tuple[str, ...]) -> None:
        match action:
            case "grasp", gripper, box:
                self.holds[gripper] = box
                del self.support[box]
            case "take", gripper, giver, box:
                self.holds[gripper] = self.holds.pop(giver)
            case "place", gripper, box, table:
                del self.holds[gripper]
                self.support[box] = table


def _start(plan: Plan) -> State:
    holds = {box["on"]: name for name, box in plan.boxes.items() if box["on"] in plan.hands}
    stands = {name: box["on"] for name, box in plan.boxes.items() if name not in holds.values()}
    return State(stands, holds)


def _legal(plan: Plan) -> Iterator[Fault]:
    state = _start(plan)
    for action in plan.actions:
        why = _illegal(plan, state, action)
        if why:
            yield Fault("logic", None, f"{_text(action)}: {why}")
            return
        state.apply(action)


def _illegal(plan: Plan, state: State, action: tuple[str, ...]) -> str:
    """Why an action is not allowed in a state; empty if it is."""
    kind, gripper, *others = action
    box = others[-1] if kind == "take" else others[0]
    givers = others[:-1] if kind == "take" else []
    table = others[1] if kind == "place" else None
    if not {gripper, *givers} <= plan.hands.keys() or box not in plan.boxes:
        return "a name is not in the scene"
    if table is not None and table not in plan.boxes.keys() | plan.tables.keys():
        return "a name is not in the scene"
    if table is None and gripper in state.holds:
        return f"{gripper} is not free"
    if kind == "grasp" and box in state.holds.values():
        return f"{box} is held already"
    if any(state.holds.get(giver) != box for giver in givers):
        return f"{givers[0]} does not hold {box}"
    if givers and state.carried(box):
        return f"{box} carries others"
    if table is not None and state.holds.get(gripper) != box:
        return f"{gripper} does not hold {box}"
    if table is not None and box in state.chain(table):
        return f"{table} stands on {box}"
    return ""


def _text(words: Sequence[str]) -> str:
    return f"({' '.join(words)})"


class _UnmatchedError(Exception):
    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.text)
        self.fault = fault


@dataclass(frozen=True)
class Event:
    """An action takes effect at a row: a gripper takes hold of a box, another lets go of it."""

    action: tuple[str, ...]
    row: int
    taken: Attachment | None
    released: Attachment | None


def _in_hands(plan: Plan) -> list[Attachment]:
    """Of the boxes that are in a hand at the start."""
    holds = _start(plan).holds
    return [a for a in plan.attachments if a.start == 0 and holds.get(a.gripper) == a.box]


def _taken(plan: Plan, events: Sequence[Event]) -> list[Attachment]:
    """Of the boxes that grippers hold, from the start or since an action."""
    return [*_in_hands(plan), *(event.taken for event in events if event.taken is not None)]


def _events(plan: Plan) -> list[Event]:
    """When each action takes effect, in the order of the actions.

    A grasp or take begins the first attachment of its pair from then on; the next place of its
    gripper, or take from it, ends it. Other attachments must belong to boxes that ride on a held
    one.
    """
    events: list[Event] = []
    held = {attachment.gripper: attachment for attachment in _in_hands(plan)}
    now, last = 0, len(plan.times) - 1
    for action in plan.actions:
        kind, gripper, *others = action
        box, taken, released = others[-1] if kind == "take" else others[0], None, None
        if kind == "place":
            released = held.pop(gripper)
            row = released.end
            if row < now:
                text = f"{_text(action)}: takes effect before the action before it"
                raise _UnmatchedError(Fault("order", row, text))
        else:
            mine = [a for a in plan.attachments if a[:2] == (box, gripper)]
            later = [a for a in mine if a.start >= now]
            if not later:
                text = f"{_text(action)}: no attachment from row {now} on"
                raise _UnmatchedError(Fault("order" if mine else "attachment", now, text))
            held[gripper] = taken = later[0]
            row = taken.start
            if kind == "take":
                released = held.pop(others[0])
                if released.end != row:
                    text = f"{_text(action)}: {others[0]} lets go at row {released.end}"
                    raise _UnmatchedError(Fault("attachment", row, text))
        events.append(Event(action, row, taken, released))
        now = row
    for gripper, attachment in held.items():
        if attachment.end != last:
            text = f"{attachment.box} leaves {gripper} without being placed"
            raise _UnmatchedError(Fault("attachment", attachment.end, text))
    return events


def _states(plan: Plan, events: Sequence[Event]) -> list[State]:
    """The state from every row on."""
    state, states = _start(plan), []
    pending = list(events)
    for row in range(len(plan.times)):
        while pending and pending[0].row <= row:
            state = State(dict(state.support), dict(state.holds))
            state.apply(pending.pop(0).action)
        states.append(state)
    return states


def _carriers(plan: Plan, events: Sequence[Event]) -> Iterator[Fault]:
    """What the gripper carries by the actions, and nothing else, is rigid in it."""
    states = _states(plan, events)[:-1]
    for box in plan.boxes:
        for interval, state in enumerate(states):
            told = [a.gripper for a in plan.attachments if a.box == box and _spans(a, interval)]
            expected = [gripper for gripper in [state.carrier(box)] if gripper]
            if told != expected:
                text = f"{box} is rigid in {told or 'nothing'}, by the actions in {expected}"
                yield Fault("attachment", interval, text)
                break


def _spans(attachment: Attachment, interval: int) -> bool:
    return attachment.start <= interval < attachment.end


def _goals(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    state = _start(plan)
    for event in events:
        state.apply(event.action)
    for goal in plan.goals:
        if not _achieved(plan, state, motion, goal):
            yield Fault("goal", len(plan.times) - 1, f"{_text(goal)} does not hold at the end")


def _achieved(plan: Plan, state: State, motion: Motion, goal: tuple[str, ...]) -> bool:
    match goal:
        case "held", box:
            return box in state.holds.values()
        case "on", box, table:
            return state.support.get(box) == table
        case "heldby", box, gripper:
            return state.holds.get(gripper) == box
        case "empty", gripper:
            return gripper in plan.hands and gripper not in state.holds
        case ("handempty",):
            return not state.holds
        case "at", box, table, *numbers:
            there = _is_at(motion.boxes[box][-1], [float(number) for number in numbers])
            return state.support.get(box) == table and there
        case "in", box, table, *numbers:
            inside = _is_in(plan, motion, box, table, [float(number) for number in numbers])
            return state.support.get(box) == table and inside
        case "upright", box:  # at rest it is level anyway, so that all of the way counts
            return box in motion.boxes and _stays_level(plan, motion, box)
        case "posture", gripper, *numbers:
            return gripper in plan.hands and _ends_at(plan, gripper, list(map(float, numbers)))
    return False


def _ends_at(plan: Plan, gripper: str, values: list[float]) -> bool:
    joints = plan.hands[gripper].joints
    last = [plan.q[-1][plan.joints.index(joint)] for joint in joints]
    return len(values) == len(last) and np.allclose(last, values, rtol=0, atol=ROUNDING)


def _is_at(pose: np.ndarray, numbers: list[float]) -> bool:
    x, y, z, yaw, near, turned = [*numbers, *(NEAR, TURNED)[len(numbers) - 4 :]]
    turn = Rotation.from_matrix(pose[:3, :3]) * Rotation.from_euler("z", -yaw)
    way = float(np.linalg.norm(pose[:3, 3] - (x, y, z)))
    return way <= near + 1e-6 and turn.magnitude() <= turned + SAME_ANGLE


def _is_in(plan: Plan, motion: Motion, box: str, table: str, region: list[float]) -> bool:
    frame = motion.boxes[table][-1] if table in plan.boxes else _scene_pose(plan, table)
    corners = _points(motion.boxes[box][-1:], _face(_body(plan.boxes[box]), -1))[0, :3].T
    local = (corners - frame[:3, 3]) @ frame[:3, :3]
    low, high = np.array(region[:2]) - EDGE, np.array(region[2:]) + EDGE
    return bool(((local[:, :2] >= low) & (local[:, :2] <= high)).all())


def _stays_level(plan: Plan, motion: Motion, box: str) -> bool:
    corners = _points(motion.boxes[box], _face(_body(plan.boxes[box]), -1))
    width = float(np.linalg.norm(plan.boxes[box]["size"][:2]))
    return bool((np.ptp(corners[:, 2], axis=1) <= UPRIGHT * width).all())


# --- the robot -----------------------------------------------------------------------------------


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
        self.base = _planar(*plan.base)
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
        return _corners(2 * shape.halfSide)
    mesh = np.array([shape.vertex(index) for index in range(shape.num_vertices)])
    return mesh[ConvexHull(mesh).vertices]


def _corners(size: Sequence[float]) -> np.ndarray:
    return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size


def _starts(plan: Plan) -> Iterator[Fault]:
    for name, value in plan.start.items():
        found = plan.q[0, plan.joints.index(name)]
        if abs(found - value) > ROUNDING:
            yield Fault("start", 0, f"{name} starts at {found:.3f}, in the scene at {value:.3f}")


def _limits(plan: Plan, robot: Robot) -> Iterator[Fault]:
    fixed = [(name, np.array([value])) for name, value in plan.fixed.items()]
    for name, values in [*fixed, *zip(plan.joints, plan.q.T, strict=True)]:
        lower, upper = robot.limits(name)
        beyond = np.maximum(lower - values, values - upper)
        row = int(beyond.argmax())
        if beyond[row] > ROUNDING:
            text = f"{name} = {values[row]:.3f}, limits {lower:.3f} to {upper:.3f}"
            yield Fault("limit", row, text)


def _velocities(plan: Plan, robot: Robot) -> Iterator[Fault]:
    speeds = np.abs(np.diff(plan.q, axis=0)) / np.diff(plan.times)[:, None]
    for name, speed in zip(plan.joints, speeds.T, strict=True):
        limit = robot.model.velocityLimit[robot.joint(name).idx_v]
        interval = int(speed.argmax())
        if speed[interval] > limit * (1 + ROUNDING):
            text = f"{name} moves at {speed[interval]:.2f} rad/s, limit {limit:.2f}"
            yield Fault("velocity", interval, text)


def _mimics(plan: Plan) -> Iterator[Fault]:
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


# --- the boxes -----------------------------------------------------------------------------------


def _carry(plan: Plan, tools: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Poses (n, 4, 4) of the boxes: at rest, or rigid in the tool frame they are attached to."""
    rows = len(plan.times)
    poses = {name: np.tile(_scene_pose(plan, name), (rows, 1, 1)) for name in plan.boxes}
    for gripper, name in _start(plan).holds.items():
        grasp = np.eye(4)
        grasp[:3, 3] = plan.boxes[name]["grasp"][:3]
        grasp[:3, :3] = Rotation.from_quat(plan.boxes[name]["grasp"][3:]).as_matrix()
        poses[name][:] = tools[gripper][0] @ grasp
    for box, gripper, start, end in plan.attachments:
        tool, pose = tools[gripper], poses[box]
        pose[start : end + 1] = tool[start : end + 1] @ (_inverse(tool[start]) @ pose[start])
        pose[end + 1 :] = pose[end]
    return poses


def _inverse(pose: np.ndarray) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def _standing(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """Every box that is not held stands on its support, at the start and after every action.

    Level, at the support's height, and with the centre of mass of it and all that it carries over
    the support. A box that carries others is level all the way.
    """
    states = _states(plan, events)
    rows = sorted({0, *(event.row for event in events), len(states) - 1})
    reported = set()
    for row in rows:
        for box, support in states[row].support.items():
            poses = {name: pose[row] for name, pose in motion.boxes.items()}
            why = _unstable(plan, states[row], box, support, poses)
            if why and (box, support) not in reported:
                reported.add((box, support))
                yield Fault("support", row, f"{box} on {support}: {why}")
    for box, pose in motion.boxes.items():
        rise = np.ptp(_points(pose, _face(_body(plan.boxes[box]), -1))[:, 2], axis=1)
        loaded = [state.carried(box) != [] for state in states]
        tilted = np.flatnonzero(np.array(loaded) & (rise > ON_SUPPORT))
        if tilted.size:
            row = int(tilted[0])
            text = f"{box} is tilted by {1e3 * rise[row]:.0f} mm under {states[row].carried(box)}"
            yield Fault("support", row, text)


def _unstable(
    plan: Plan, state: State, box: str, support: str, poses: Mapping[str, np.ndarray]
) -> str | None:
    bodies = plan.boxes | plan.tables
    top, base = _face(_body(bodies[support]), 1), _face(_body(bodies[box]), -1)
    below = poses[support] if support in plan.boxes else _scene_pose(plan, support)
    into = _inverse(below @ _planar(0, 0, top[:, 2].max(), 0))
    gaps = (into @ poses[box] @ _homogeneous(base).T)[2]
    if np.abs(gaps).max() > ON_SUPPORT:
        return f"the bottom is {1e3 * gaps.min():.0f} to {1e3 * gaps.max():.0f} mm above it"
    stack = [box, *state.carried(box)]
    masses = [ConvexHull(_body(plan.boxes[name])).volume for name in stack]
    centre = np.average([poses[name][:, 3] for name in stack], axis=0, weights=masses)
    if not _over(into @ centre, top):
        return f"the centre of {' '.join(stack)} is not over it"
    if not _over(_inverse(poses[box]) @ centre, base):
        return f"the centre of {' '.join(stack)} is not over its base"
    return None


def _over(point: np.ndarray, face: np.ndarray) -> bool:
    """Whether a point (4,) is above the hull of a face (n, 3), both in the frame of the body."""
    edges = ConvexHull(face[:, :2]).equations
    return bool((edges @ (point[0], point[1], 1.0) <= 0).all())


def _homogeneous(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.ones(len(points))])


def _keyframes(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """Keyframe k is the path where action k takes effect."""
    for number, (event, keyframe) in enumerate(zip(events, plan.keyframes, strict=True)):
        apart = np.abs(keyframe.q - plan.q[event.row])
        if apart.max() > ROUNDING:
            name = plan.joints[int(apart.argmax())]
            text = f"keyframe {number}: {name} is {apart.max():.3f} rad off the path"
            yield Fault("keyframe", event.row, text)
        for name, (position, yaw) in keyframe.boxes.items():
            pose = motion.boxes[name][event.row]
            off = np.linalg.norm(position - pose[:3, 3])
            turn = yaw - np.arctan2(pose[1, 0], pose[0, 0])
            upright = pose[2, 2] > np.cos(SAME_ANGLE)
            if off > SAME_POSITION or (upright and abs(np.sin(turn / 2)) > SAME_ANGLE / 2):
                text = f"keyframe {number}: {name} is not where the path has it ({off:.3f} m)"
                yield Fault("keyframe", event.row, text)


# --- the grippers --------------------------------------------------------------------------------


def _leaves(tool: np.ndarray, row: int, distance: float, step: Literal[-1, 1]) -> int | None:
    """The first row from ``row`` on (step 1) or back at which the tool is that far away."""
    away = np.linalg.norm(tool[:, :3, 3] - tool[row, :3, 3], axis=1) > distance
    rows = np.flatnonzero(away[row:] if step > 0 else away[row::-1])
    return row + step * int(rows[0]) if rows.size else None


def _fingers(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """The fingers are open on the way to a box, closed while they hold it, open on the way off."""
    released = [event.released for event in events]
    for box, gripper, start, end in _held(plan, events):
        tool = motion.tools[gripper]
        opening = plan.q[:, plan.joints.index(plan.hands[gripper].fingers[0])]
        left = _leaves(tool, end, AWAY, 1)
        given = Attachment(box, gripper, start, end) in released
        if given and left is not None and opening[left] < opening[end] + OPENED:
            yield Fault("fingers", left, f"{gripper} leaves {box} without opening")
        came = _leaves(tool, start, AWAY, -1)
        if came is not None and opening[came] < opening[start] + OPENED:
            yield Fault("fingers", came, f"{gripper} comes to {box} without opening")
        moved = np.abs(opening[start : end + 1] - opening[start])
        if moved.max() > ROUNDING:
            yield Fault("fingers", start + int(moved.argmax()), f"{gripper} moves fingers on {box}")


def _held(plan: Plan, events: Sequence[Event]) -> Iterator[Attachment]:
    """Boxes in hands whose fingers move."""
    for taken in _taken(plan, events):
        if plan.hands[taken.gripper].fingers:
            yield taken


def _grasps(plan: Plan, robot: Robot, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """When a gripper takes hold of a box, fingers are at it on opposite sides of it.

    Of a box that has grasps of its own, it is one of them.
    """
    with _World(plan, robot) as world:
        for taken in _taken(plan, events):
            box, gripper, row, _ = taken
            hand = plan.hands[gripper]
            into = _inverse(motion.tools[gripper][row])
            sides = set()
            # the palm is the first link; where the jaws do not move, they may be one with it
            for hull in robot.hull_names(hand.links[1:] if hand.fingers else hand.links):
                poses = {hull: motion.links[hull][row], box: motion.boxes[box][row]}
                for on_box, _ in world.closest(hull, box, poses, AT_BOX):
                    sides.add(np.sign((into @ (*on_box, 1))[1]))
            if not {-1.0, 1.0} <= sides:
                text = f"{gripper} does not have {box} between its fingers"
                yield Fault("grasp", row, text)
            given = plan.boxes[box].get("grasps")
            now = _inverse(motion.boxes[box][row]) @ motion.tools[gripper][row]
            if given and not any(_near(np.array(grasp), now) for grasp in given):
                yield Fault("grasp", row, f"{gripper} holds {box} in none of its grasps")


def _near(grasp: np.ndarray, now: np.ndarray) -> bool:
    turn = Rotation.from_quat(grasp[3:]).inv() * Rotation.from_matrix(now[:3, :3])
    way = float(np.linalg.norm(grasp[:3] - now[:3, 3]))
    return way <= SAME_GRASP and turn.magnitude() <= SAME_ANGLE


# --- collisions ----------------------------------------------------------------------------------


class _World:
    """The hulls in a PyBullet client of its own."""

    def __init__(self, plan: Plan, robot: Robot) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        self.vertices = dict(robot.hulls)
        for name, item in (plan.boxes | plan.tables | plan.obstacles).items():
            self.vertices[name] = _body(item)
        height = plan.base[2]
        if plan.column:
            column = _corners((2 * plan.stand[0], 2 * plan.stand[1], height))
            self.vertices[COLUMN] = column - (0, 0, height / 2)
        self.bodies = {}
        for name, vertices in self.vertices.items():
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=vertices.tolist(), physicsClientId=self.client
            )
            self.bodies[name] = pybullet.createMultiBody(0, shape, physicsClientId=self.client)

    def __enter__(self) -> "_World":
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(self.client)

    def closest(
        self, first: str, second: str, poses: Mapping[str, np.ndarray], within: float
    ) -> list[tuple[tuple[float, ...], float]]:
        """Closest points on the second body, with distances (below zero: penetration)."""
        for name in (first, second):
            pybullet.resetBasePositionAndOrientation(
                self.bodies[name],
                poses[name][:3, 3],
                Rotation.from_matrix(poses[name][:3, :3]).as_quat(),
                physicsClientId=self.client,
            )
        points = pybullet.getClosestPoints(
            self.bodies[first], self.bodies[second], within, physicsClientId=self.client
        )
        return [(point[6], point[8] + 2 * HULL_MARGIN) for point in points]


def _samples(plan: Plan, robot: Robot, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Intervals (m,) and joint positions (m, joints) so close that no link point moves a step."""
    vertices = robot.hulls | {name: _body(box) for name, box in plan.boxes.items()}
    reach = np.zeros(len(plan.times) - 1)
    for name, pose in (motion.links | motion.boxes).items():
        moves = np.linalg.norm(np.diff(_points(pose, vertices[name]), axis=0), axis=1)
        reach = np.maximum(reach, moves.max(axis=1))
    counts = np.maximum(1, np.ceil(1.1 * reach / STEP)).astype(int)  # an arc exceeds its chord
    intervals = np.repeat(np.arange(len(counts)), counts)
    fraction = np.concatenate([np.arange(count) / count for count in counts])[:, None]
    q = (1 - fraction) * plan.q[intervals] + fraction * plan.q[intervals + 1]
    return np.append(intervals, len(counts) - 1), np.vstack([q, plan.q[-1]])


def _points(poses: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """The vertices (k, 3) at every pose (n, 4, 4): (n, 3, k)."""
    return poses[:, :3] @ _homogeneous(vertices).T


def _collisions(
    plan: Plan, robot: Robot, events: Sequence[Event], motion: Motion
) -> Iterator[Fault]:
    """Pairs of bodies that overlap by more than the tolerance, each where it is deepest.

    A box and its support touch without overlapping, so the tolerance is all they need.
    """
    intervals, q = _samples(plan, robot, motion)
    dense, grips = robot.forward(q)
    for name, pose in motion.boxes.items():
        dense[name] = pose[intervals]
    for box, gripper, start, end in plan.attachments:
        held = (intervals >= start) & (intervals < end)
        in_hand = _inverse(motion.tools[gripper][start]) @ motion.boxes[box][start]
        dense[box][held] = grips[gripper][held] @ in_hand
        dense[box][intervals >= end] = motion.boxes[box][end]
    for table in (*plan.tables, *plan.obstacles):
        dense[table] = np.tile(_scene_pose(plan, table), (len(q), 1, 1))
    dense[COLUMN] = np.tile(robot.base, (len(q), 1, 1))
    declared = _declared_contacts(plan, robot, events, motion)
    with _World(plan, robot) as world:
        ranges = {}
        for name, vertices in world.vertices.items():
            points = _points(dense[name], vertices)
            ranges[name] = points.min(axis=2), points.max(axis=2)
        for first, second in _pairs(plan, robot):
            (low, high), (low2, high2) = ranges[first], ranges[second]
            allowed = np.full(len(q), PENETRATION)
            for begin, end in declared.get((first, second), []):
                allowed[(intervals >= begin) & (intervals < end)] = IN_HAND
            overlap = (np.minimum(high, high2) - np.maximum(low, low2)).min(axis=1)
            depths = np.zeros(len(q))
            for sample in np.flatnonzero(overlap > allowed):  # the depth is at most the overlap
                at = {name: dense[name][sample] for name in (first, second)}
                found = [-distance for _, distance in world.closest(first, second, at, 0.0)]
                depths[sample] = max(found, default=0.0)
            worst = int((depths - allowed).argmax())
            if depths[worst] > allowed[worst]:
                row = int(intervals[worst])
                one, other = (robot.link.get(name, name) for name in (first, second))
                text = f"{one} is {1e3 * depths[worst]:.0f} mm inside {other}"
                yield Fault("collision", row, f"{text} at {plan.times[row]:.2f} s")


def _pairs(plan: Plan, robot: Robot) -> Iterator[tuple[str, str]]:
    disabled = set()
    if plan.srdf is not None:
        pairs = ET.parse(plan.srdf).getroot().iter("disable_collisions")
        disabled = {frozenset((pair.get("link1"), pair.get("link2"))) for pair in pairs}
    column = [COLUMN] if plan.column else []
    bodies = [*plan.boxes, *plan.tables, *plan.obstacles, *column]
    still = {*robot.fixed, *plan.tables, *plan.obstacles, *column}  # what touches there always does
    for pair in itertools.combinations([*robot.hulls, *bodies], 2):
        links = frozenset(robot.link.get(name, name) for name in pair)
        if len(links) == 2 and links not in disabled and not set(pair) <= still:
            yield pair


def _declared_contacts(
    plan: Plan, robot: Robot, events: Sequence[Event], motion: Motion
) -> dict[tuple[str, str], list[tuple[int, int]]]:
    """Intervals, by link of a hand and box, from the approach to a box to the retreat from it."""
    contacts: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for box, gripper, start, end in _taken(plan, events):
        tool = motion.tools[gripper]
        begin = _leaves(tool, start, APPROACH, -1) or 0
        until = _leaves(tool, end, APPROACH, 1) or len(tool)
        for hull in robot.hull_names(plan.hands[gripper].links):
            contacts.setdefault((hull, box), []).append((begin, until))
    return contacts
