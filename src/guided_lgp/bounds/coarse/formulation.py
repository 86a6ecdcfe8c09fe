"""From a skeleton to the nonlinear program: kinematic modes, variables and kernel instances.

A grasped box is rigid in the gripper from its grasp to its place (one pitch and offset for the
whole mode); a placed box is rigid on its support (one pose shared by all later actions). The other
arm stands at its side, except while the box that it holds carries others: then it holds that box
level, lifted in place (if the box carried something when it was grasped) or where it presents it
(if something was placed on it since), and its joints are variables of the program too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from guided_lgp.bounds.coarse.kernels import RADII, STACK, kernel_index, kernels
from guided_lgp.bounds.coarse.kinematics import COARSE_SPHERES, SPHERES
from guided_lgp.bounds.coarse.solver import Integers, Program
from guided_lgp.bounds.results import Array
from guided_lgp.logic import Action, Skeleton, State, successor
from guided_lgp.poses import inverse, yaw_of
from guided_lgp.scene import GRIPPERS, Scene, pr2
from guided_lgp.scene.world import TABLE_THICKNESS

GRASPABLE = 0.085
"""Widest side (m) that the fingers close on."""
LIFT = 0.08
"""How far a box that carries others is lifted (m)."""
SIDES = {"pr2L": 1.0, "pr2R": -1.0}
_ZERO = -1
"""Slot of the constant 0."""
_TOUCH = 0.002
"""Heights (m) that differ by less are one."""
_PAD_MARGIN = 0.01
_PRESENTED = (0.55, 0.0, 0.95)
"""Where a held box is offered as a support, in the robot's frame: the start of the search (m)."""


@dataclass(frozen=True)
class Margins:
    """Distances (m) that the program keeps."""

    clear: float = 0.004
    """Link spheres to boxes and tables."""
    arms: float = 0.005
    """Link spheres of one arm to the other's."""
    beside: float = 0.006
    """Box to box."""
    support: float = 0.012
    """Centre of mass to the edge of the support."""
    approach: float = 0.09
    """Length of the straight way to a grasp and from a place, along the hand."""
    lift: float = 0.04
    """Length of the straight way up after a grasp."""
    lower: float = 0.08
    """Length of the straight way down to a place."""


@dataclass(frozen=True)
class Body:
    """A box or table: half extents (m)."""

    name: str
    half: tuple[float, float, float]
    mass: float


@dataclass(frozen=True)
class Level:
    """Pose of a level body: slots of x, y, yaw and z in the values, and an offset of z (m)."""

    x: int
    y: int
    yaw: int
    z: int
    offset: float

    @property
    def plane(self) -> tuple[int, int, int]:
        """Slots of x, y and yaw."""
        return self.x, self.y, self.yaw

    def raised(self, height: float) -> "Level":
        """The same place, higher (m)."""
        return replace(self, offset=self.offset + height)


@dataclass(frozen=True)
class Leg:
    """The far end of a straight segment from a contact, the hand not turned, the pan unchanged."""

    joints: tuple[int, ...]
    back: float
    """How far the hand is back along its approach (m)."""
    up: float
    """How far it is up (m)."""


@dataclass(frozen=True)
class Posture:
    """An arm that holds a level box: seven joint slots and the box's pose."""

    action: int
    gripper: str
    joints: tuple[int, ...]
    level: Level
    legs: tuple[Leg, ...] = ()
    free: bool = False
    """Whether the pose itself is chosen here (a held box presented as a support)."""


@dataclass
class Mode:
    """A box in a gripper, from its grasp to its place."""

    gripper: str
    box: str
    pitch: int
    offset: int
    turn: float
    half_length: float
    half_height: float
    postures: list[Posture] = field(default_factory=list)


@dataclass(frozen=True)
class Placement:
    """A box put on a support; the boxes that it carries move along (old and new poses)."""

    action: int
    box: str
    level: Level
    support: Level
    half: tuple[float, float]
    """Half extents (m) within which the centre must be."""
    carried: tuple[tuple[Level, Level], ...]
    old: Level


@dataclass(frozen=True)
class Separation:
    """Two level boxes beside each other, and the slot of the angle that separates them."""

    angle: int
    first: Level
    second: Level
    halves: tuple[float, float, float, float]


@dataclass(frozen=True)
class Snapshot:
    """Where everything is at one configuration: joint slots by gripper, and boxes."""

    joints: dict[str, tuple[int, ...] | None]
    """None: at its side."""
    boxes: dict[str, Level | Mode]
    """A level pose, or the mode of a box held at the arm's side."""


@dataclass(frozen=True)
class Row:
    """What a kernel instance means: the name of its constraint and the action it belongs to."""

    action: int
    kernel: int
    names: tuple[str, ...]


@dataclass(frozen=True)
class Formulation:
    """The program of a skeleton, and what its variables mean."""

    program: Program
    constants: Array
    rows: tuple[Row, ...]
    modes: tuple[Mode, ...]
    steps: tuple[tuple[Mode | Placement | Separation | Posture, ...], ...]
    """What each action adds, for the start."""
    at_switch: tuple[Snapshot, ...]
    after_action: tuple[Snapshot, ...]

    def level(self, values: Array, where: Level) -> tuple[float, float, float, float]:
        """x, y, yaw and z of a level body."""
        x, y, yaw, z = (
            float(values[slot if slot >= 0 else self.program.variables - 1 - slot])
            for slot in (*where.plane, where.z)
        )
        return x, y, yaw, z + where.offset


class UngraspableError(Exception):
    """No side of a box is narrow enough for the fingers."""

    def __init__(self, action: int, box: str, width: float) -> None:
        super().__init__(f"box {box!r} is {width:.3f} m wide")
        self.action, self.box, self.width = action, box, width


class SceneGeometry:
    """Bodies and initial poses of a scene in the robot's frame."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        to_robot = inverse(pr2.base_pose(scene))
        self._turn = float(yaw_of(to_robot))
        self._shift = to_robot[:3]
        self.bodies: dict[str, Body] = {}
        self.poses: dict[str, tuple[float, float, float, float]] = {}
        for table in scene.tables:
            half = (*table.half_extents, TABLE_THICKNESS / 2)
            self._add(table.name, half, table.position, table.yaw, -TABLE_THICKNESS / 2)
        for box in scene.boxes:
            sx, sy, sz = box.size
            self._add(box.name, (sx / 2, sy / 2, sz / 2), box.position, box.yaw, 0.0)
        self.tables = tuple(table.name for table in scene.tables)
        self.boxes = tuple(box.name for box in scene.boxes)

    def _add(
        self,
        name: str,
        half: tuple[float, float, float],
        position: Sequence[float],
        yaw: float,
        raised: float,
    ) -> None:
        cosine, sine = np.cos(self._turn), np.sin(self._turn)
        x, y, z = position
        self.bodies[name] = Body(name, half, 8 * half[0] * half[1] * half[2])
        self.poses[name] = (
            float(cosine * x - sine * y + self._shift[0]),
            float(sine * x + cosine * y + self._shift[1]),
            yaw + self._turn,
            z + raised,
        )

    def in_world(self, x: float, y: float, yaw: float, z: float) -> Array:
        """Pose (7,) in the world of a level body in the robot's frame."""
        base_x, base_y, base_yaw = self.scene.robot.base
        cosine, sine = math.cos(base_yaw), math.sin(base_yaw)
        half = (yaw + base_yaw) / 2
        position = (base_x + cosine * x - sine * y, base_y + sine * x + cosine * y, z)
        return np.array([*position, 0.0, 0.0, math.sin(half), math.cos(half)])

    def grasp_side(self, name: str) -> tuple[float, float, float]:
        """How the fingers close on a box: turn of its length against x, half length, width."""
        hx, hy, hz = self.bodies[name].half
        if pr2.grasp_axis((2 * hx, 2 * hy, 2 * hz)) == 1:
            return 0.0, hx, 2 * hy
        return np.pi / 2, hy, 2 * hx


class Formulator:
    """Builds the program of one skeleton."""

    def __init__(self, geometry: SceneGeometry, margins: Margins) -> None:
        self._geometry = geometry
        self._margins = margins
        self._torso = geometry.scene.robot.torso
        self._constants: list[float] = [0.0]
        self._lower: list[float] = []
        self._upper: list[float] = []
        self._weight: list[float] = []
        self._target: list[float] = []
        self._shared: list[bool] = []
        self._kernel: list[int] = []
        self._inputs: list[int] = []
        self._parameters: list[float] = []
        self._rows: list[Row] = []
        self._modes: list[Mode] = []
        self._steps: list[list[Mode | Placement | Separation | Posture]] = []
        self._balanced: set[tuple[object, ...]] = set()
        self._separated: set[frozenset[tuple[int, int, int]]] = set()
        self._action = 0
        self._state: State = geometry.scene.state
        self._level: dict[str, Level] = {
            name: self._constant_level(pose) for name, pose in geometry.poses.items()
        }
        self._held: dict[str, Mode] = {}
        self._joints: dict[str, tuple[int, ...]] = {}
        self._home = {
            gripper: tuple(self._constant(value) for value in _mirrored(gripper, pr2.HOME[gripper]))
            for gripper in GRIPPERS
        }

    def build(self, skeleton: Skeleton) -> Formulation:
        """The program of a skeleton whose actions are applicable one after the other.

        Raises:
            UngraspableError: no side of a box to grasp is narrow enough.
        """
        at_switch, after_action = [], []
        for index, action in enumerate(skeleton):
            self._action = index
            self._steps.append([])
            at_switch.append(self._grasp(action) if action.table is None else self._place(action))
            self._state = successor(self._state, action)
            self._retreat()
            after_action.append(self._snapshot())
        return self._finish(tuple(at_switch), tuple(after_action))

    # actions

    def _grasp(self, action: Action) -> Snapshot:
        gripper, box = action.gripper, action.box
        mode = self._mode(gripper, box)
        margins = self._margins
        legs = ((margins.approach, 0.0), (0.0, margins.lift))
        posture = self._posture(mode, self._level[box], legs)
        contact = self._snapshot({gripper: posture.joints})
        self._avoid(posture, excluded=(box,))
        self._held[box] = mode
        carried = self._state.carried_by(box)
        support = self._state.support_of(box)
        assert support is not None
        self._separate((box, *carried), support)
        if carried:
            for name in (box, *carried):
                self._level[name] = self._level[name].raised(LIFT)
            lifted = self._posture(mode, self._level[box], ())
            self._avoid(lifted, excluded=(box,))
            self._joints[gripper] = lifted.joints
        if support in self._geometry.boxes:
            rest = successor(self._state, action)
            self._balance(rest, support)
        return contact

    def _place(self, action: Action) -> Snapshot:
        gripper, box, table = action.gripper, action.box, action.table
        assert table is not None
        self._present(self._root(table))
        mode, support = self._held[box], self._level[table]
        bodies = self._geometry.bodies
        height = bodies[table].half[2] + bodies[box].half[2]
        old = self._level[box]
        new = Level(*self._plane(), support.z, support.offset + height)
        carried = self._state.carried_by(box)
        moved: list[tuple[Level, Level]] = []
        del self._held[box]
        self._level[box] = new
        for name in carried:
            above = self._level[name]
            rise = above.offset - old.offset
            after = Level(*self._plane(), new.z, new.offset + rise)
            self._instance("carried", (*old.plane, *above.plane, *new.plane, *after.plane), ())
            self._name("carried", name, box)
            moved.append((above, after))
            self._level[name] = after
        half = bodies[table].half
        margin = self._margins.support
        inner = (max(half[0] - margin, 1e-3), max(half[1] - margin, 1e-3))
        placement = Placement(self._action, box, new, support, inner, tuple(moved), old)
        self._steps[-1].append(placement)
        self._balance(successor(self._state, action), box)
        self._separate((box, *carried), table)
        legs = ((0.0, self._margins.lower), (self._margins.approach, 0.0))
        posture = self._posture(mode, new, legs)
        self._avoid(posture, excluded=(box,))
        for other, joints in self._joints.items():
            if other != gripper:
                self._clear(other, joints, box)
        return self._snapshot({gripper: posture.joints})

    def _retreat(self) -> None:
        """Arms whose box carries nothing (any more) go to their side."""
        self._joints = {
            gripper: joints
            for gripper, joints in self._joints.items()
            if (held := self._state.held_by(gripper)) is not None and self._state.standing_on(held)
        }

    def _present(self, root: str) -> None:
        """Hold a box level if it is held at the arm's side and is to carry something."""
        mode = self._held.get(root)
        if mode is None or mode.gripper in self._joints:
            return
        hz = self._geometry.bodies[root].half[2]
        lowest = hz + 0.02 + max(self._top(name) for name in self._level if name != root)
        x, y, z = _PRESENTED
        level = Level(
            self._variable(0.2, 0.9, 0.01, x),
            self._variable(-0.6, 0.6, 0.01, y * SIDES[mode.gripper]),
            self._variable(-2 * np.pi, 2 * np.pi, 1e-3, 0.0),
            self._variable(lowest, 1.5, 0.01, z),
            0.0,
        )
        self._level[root] = level
        posture = self._posture(mode, level, (), free=True)
        self._joints[mode.gripper] = posture.joints
        self._avoid(posture, excluded=(root,))

    def _top(self, name: str) -> float:
        """Height of a table's or standing box's top; the floor for what is held."""
        level = self._level[name]
        standing = self._state.holder(name) is None and level.z == _ZERO
        return level.offset + self._geometry.bodies[name].half[2] if standing else 0.0

    # parts of a mode

    def _mode(self, gripper: str, box: str) -> Mode:
        turn, along, width = self._geometry.grasp_side(box)
        if width > GRASPABLE:
            raise UngraspableError(self._action, box, width)
        half = self._geometry.bodies[box].half
        reach = max(along, half[2]) - _PAD_MARGIN
        mode = Mode(
            gripper,
            box,
            self._variable(0.0, np.pi, 1e-3, np.pi / 2),
            self._variable(-reach, reach, 0.05, 0.0),
            turn,
            along,
            half[2],
        )
        inner = (along - _PAD_MARGIN, half[2] - _PAD_MARGIN)
        self._instance("pads", (mode.pitch, mode.offset), (along, half[2], *inner))
        self._name("grip", gripper, box)
        self._modes.append(mode)
        self._steps[-1].append(mode)
        return mode

    def _posture(
        self,
        mode: Mode,
        level: Level,
        legs: tuple[tuple[float, float], ...],
        free: bool = False,
    ) -> Posture:
        """The arm holds its box at a level pose, and can move straight to the ends of the legs."""
        joints = self._arm_variables(mode, 0)
        self._hold(mode, joints, level, 0.0, 0.0)
        ends = []
        for back, up in legs:
            end = (joints[0], *self._arm_variables(mode, 1))
            self._hold(mode, end, level, back, up)
            ends.append(Leg(end, back, up))
        posture = Posture(self._action, mode.gripper, joints, level, tuple(ends), free)
        mode.postures.append(posture)
        self._steps[-1].append(posture)
        return posture

    def _arm_variables(self, mode: Mode, first: int) -> tuple[int, ...]:
        home = _mirrored(mode.gripper, pr2.HOME[mode.gripper])
        limits = pr2.JOINT_LIMITS[:7].tolist()
        return tuple(
            self._variable(low, high, 1e-3, at, shared=False)
            for (low, high), at in zip(limits[first:], home[first:], strict=True)
        )

    def _hold(
        self, mode: Mode, joints: tuple[int, ...], level: Level, back: float, up: float
    ) -> None:
        grasp = (mode.half_length, mode.half_height, mode.turn, back)
        self._instance(
            "hold",
            (*joints, mode.pitch, mode.offset, *level.plane, level.z),
            (*self._arm(mode.gripper), level.offset, up, *grasp),
        )
        self._name("reach", mode.gripper, mode.box)

    def _avoid(self, posture: Posture, excluded: tuple[str, ...]) -> None:
        """Keep an arm clear of tables, level boxes and the other arm."""
        gripper = posture.gripper
        (other,) = (name for name in GRIPPERS if name != gripper)
        for joints in (posture.joints, *(leg.joints for leg in posture.legs)):
            for name in self._geometry.tables:
                self._clear(gripper, joints, name)
            for name in self._geometry.boxes:
                held = self._held.get(name)
                at_side = held is not None and held.gripper not in self._joints
                if name not in excluded and not at_side:
                    self._clear(gripper, joints, name)
            if joints is posture.joints or other in self._joints:
                self._instance(
                    "apart",
                    (*joints, *self._joints.get(other, self._home[other])),
                    (SIDES[gripper], SIDES[other], self._torso, self._margins.arms, *RADII),
                )
                self._name("collision", gripper, other)

    def _clear(self, gripper: str, joints: tuple[int, ...], name: str) -> None:
        level = self._level[name]
        self._instance(
            "clear",
            (*joints, *level.plane, level.z),
            (
                *self._arm(gripper),
                level.offset,
                *self._geometry.bodies[name].half,
                self._margins.clear,
                *RADII,
            ),
        )
        self._name("collision", gripper, name)

    # parts of a placement

    def _plane(self) -> tuple[int, int, int]:
        return (
            self._variable(-3.0, 3.0, 1e-3, 0.5),
            self._variable(-3.0, 3.0, 1e-3, 0.0),
            self._variable(-4 * np.pi, 4 * np.pi, 1e-4, 0.0),
        )

    def _root(self, table: str) -> str:
        """What a table stands on in the end: itself, a surface or a held box."""
        support = self._state.support_of(table)
        return table if support is None else self._root(support)

    def _balance(self, state: State, box: str) -> None:
        """Centres of mass of a box with all that it carries, and of all below it, are supported."""
        support = state.support_of(box)
        if support is None:
            return
        stack = (box, *state.carried_by(box))[:STACK]  # of higher towers, verification judges
        key = (support, *((name, self._level[name].plane) for name in stack))
        if key not in self._balanced and any(
            slot >= 0 for name in stack for slot in self._level[name].plane
        ):
            self._balanced.add(key)
            masses = np.array([self._geometry.bodies[name].mass for name in stack])
            shares = [*(masses / masses.sum()), *[0.0] * (STACK - len(stack))]
            points = [slot for name in stack for slot in self._level[name].plane[:2]]
            points += [_ZERO] * (2 * STACK - len(points))
            half = self._geometry.bodies[support].half
            margin = self._margins.support
            inner = (max(half[0] - margin, 1e-3), max(half[1] - margin, 1e-3))
            self._instance("inside", (*self._level[support].plane, *points), (*inner, *shares))
            self._name("support", box, support)
        self._balance(state, support)

    def _separate(self, moved: tuple[str, ...], support: str) -> None:
        """Boxes that come down from above, or go up, pass beside all that reaches as high."""
        for name in moved:
            for other in (*self._geometry.boxes, *self._geometry.tables):
                held = self._held.get(other)
                at_side = held is not None and held.gripper not in self._joints
                if other in moved or other == support or at_side:
                    continue
                first, second = self._level[name], self._level[other]
                bottom = first.offset - self._geometry.bodies[name].half[2]
                top = second.offset + self._geometry.bodies[other].half[2]
                variable = any(slot >= 0 for slot in (*first.plane, *second.plane))
                if variable and first.z == second.z and top > bottom + _TOUCH:
                    self._beside(name, other)

    def _beside(self, name: str, other: str) -> None:
        first, second = self._level[name], self._level[other]
        pair = frozenset((first.plane, second.plane))
        if pair in self._separated:
            return
        self._separated.add(pair)
        angle = self._variable(-4 * np.pi, 4 * np.pi, 1e-6, 0.0)
        halves = (*self._geometry.bodies[name].half[:2], *self._geometry.bodies[other].half[:2])
        self._instance(
            "beside", (*first.plane, *second.plane, angle), (*halves, self._margins.beside)
        )
        self._name("overlap", name, other)
        self._steps[-1].append(Separation(angle, first, second, halves))

    # arrays

    def _snapshot(self, acting: dict[str, tuple[int, ...]] | None = None) -> Snapshot:
        joints = {g: (acting or {}).get(g, self._joints.get(g)) for g in GRIPPERS}
        boxes: dict[str, Level | Mode] = {}
        for name in self._geometry.boxes:
            mode = self._held.get(name)
            at_side = mode is not None and joints[mode.gripper] is None
            boxes[name] = mode if mode is not None and at_side else self._level[name]
        return Snapshot(joints, boxes)

    def _arm(self, gripper: str) -> tuple[float, float]:
        return SIDES[gripper], self._torso

    def _constant(self, value: float) -> int:
        """Slots of constants are negative until the number of variables is known."""
        self._constants.append(value)
        return -len(self._constants)

    def _constant_level(self, pose: tuple[float, float, float, float]) -> Level:
        x, y, yaw, z = pose
        return Level(self._constant(x), self._constant(y), self._constant(yaw), _ZERO, z)

    def _variable(
        self, lower: float, upper: float, weight: float, target: float, shared: bool = True
    ) -> int:
        self._lower.append(lower)
        self._upper.append(upper)
        self._weight.append(weight)
        self._target.append(target)
        self._shared.append(shared)
        return len(self._lower) - 1

    def _instance(self, kernel: str, inputs: Sequence[int], parameters: Sequence[float]) -> None:
        self._kernel.append(kernel_index(kernel))
        self._inputs.extend(inputs)
        self._parameters.extend(parameters)

    def _name(self, *names: str) -> None:
        self._rows.append(Row(self._action, self._kernel[-1], names))

    def _finish(
        self, at_switch: tuple[Snapshot, ...], after_action: tuple[Snapshot, ...]
    ) -> Formulation:
        count = len(self._lower)
        sizes = np.array([[k.inputs, k.parameters, k.rows] for k in kernels()])
        starts = np.zeros((len(self._kernel) + 1, 3), dtype=np.intc)
        np.cumsum(sizes[self._kernel], axis=0, out=starts[1:])
        inputs = np.array(self._inputs, dtype=np.intc)
        inputs = np.where(inputs < 0, count - 1 - inputs, inputs).astype(np.intc)
        order = np.empty(count, dtype=np.intc)
        order[np.argsort(self._shared, kind="stable")] = np.arange(count)
        program = Program(
            kernel=np.array(self._kernel, dtype=np.intc),
            input_start=_column(starts, 0),
            inputs=inputs,
            parameter_start=_column(starts, 1),
            row_start=_column(starts, 2),
            parameters=np.array(self._parameters),
            weight=np.array(self._weight),
            target=np.array(self._target),
            lower=np.array(self._lower),
            upper=np.array(self._upper),
            order=order,
        )
        return Formulation(
            program=program,
            constants=np.array(self._constants),
            rows=tuple(self._rows),
            modes=tuple(self._modes),
            steps=tuple(map(tuple, self._steps)),
            at_switch=at_switch,
            after_action=after_action,
        )


def _column(starts: Integers, column: int) -> Integers:
    return np.ascontiguousarray(starts[:, column])


def _mirrored(gripper: str, joints: Array) -> list[float]:
    """Joint values of an arm as those of the left one, or back."""
    values = joints if SIDES[gripper] > 0 else pr2.MIRROR * joints
    return [float(value) for value in values]


def sphere_link(row: int, kernel: str) -> str:
    """The link (without its side) that a row of a collision kernel is about."""
    index = row if kernel == "clear" else COARSE_SPHERES[row // len(COARSE_SPHERES)]
    return SPHERES[index].link.removeprefix("l_")
