"""What is where at a point of a skeleton, in slots of a program: the mode tree with geometry."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from guided_lgp.bounds.program.arrays import ProgramBuilder
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.bounds.program.kernels import KernelShape, KernelTable
from guided_lgp.bounds.program.kinematics import ArmKinematics, RobotKinematics
from guided_lgp.bounds.program.slots import (
    ZERO,
    ArmConfiguration,
    HeldBox,
    KeyframeSlots,
    PlanarPose,
)
from guided_lgp.bounds.results import Array
from guided_lgp.logic import State

Aim = Callable[[np.random.Generator, int, Array], Array]
"""Draws places (count, 3) on a support (4,) for a start; see ``GoalTerm``."""


class Start(Protocol):
    """Something that a term chooses in a start."""

    def start(self, draft: Draft) -> None:
        """Give its variables values."""
        ...


class Line(NamedTuple):
    """A straight way of a hand to or from its contact: its far end (m)."""

    gripper: str
    back: float
    up: float


LOW = (0.2, 0.016)
"""Back and up (m) of a low straight way of a hand with its box, below something: as far as a box is
long, so that little of it is left there, and clear of its support where the hand is not level."""


class Context:
    """The geometry of the mode tree while a skeleton is walked; terms read it and add to it."""

    def __init__(
        self,
        geometry: SceneGeometry,
        robot: RobotKinematics,
        table: KernelTable[KernelShape],
        margins: Margins,
    ) -> None:
        """Begin before the first action.

        Args:
            geometry: of the scene.
            robot: its arms.
            table: the kernels.
            margins: distances to keep.
        """
        self.geometry = geometry
        self.robot = robot
        self.margins = margins
        self.program = ProgramBuilder(table)
        self.fixed = tuple(geometry.scene.robot.fixed_values.values())
        """Values of the joints that the scene sets."""
        self.pose: dict[str, PlanarPose] = {
            name: self._constant_pose(pose) for name, pose in geometry.poses.items()
        }
        """Of every body; of one that is held at an arm's side, where it was last."""
        self.before = dict(self.pose)
        """At the end of the last action."""
        self.held: dict[str, HeldBox] = {}
        """By box."""
        self.hands: dict[str, HeldBox] = {}
        """What hands hold, or are about to hold at the action's switch, by gripper."""
        self.standing: dict[str, ArmConfiguration] = {}
        """Arms that hold a level box, by gripper; the others are at their side."""
        self.home = {
            gripper: tuple(self.program.constant(value) for value in arm.home)
            for gripper, arm in robot.arms.items()
        }
        self.grips: list[HeldBox] = []
        """All, in the order in which they begin."""
        self.configurations: dict[HeldBox, tuple[ArmConfiguration, ...]] = {}
        """Of each grip, in the order of the actions."""
        self.choices: list[list[Start]] = []
        """What each action leaves to the start, in the order of the terms."""
        self.balanced: set[tuple[object, ...]] = set()
        self.separated: set[frozenset[tuple[int, int, int]]] = set()
        self.upright: frozenset[str] = frozenset()
        """Boxes that stay level on their way, whatever they carry."""
        self.steady: frozenset[str] = frozenset()
        """Grippers whose load does not turn what they hold."""
        self.unaided = False
        """Whether what is put down would stand without what it carries."""
        self.aims: dict[tuple[int, str], Aim] = {}
        """Where goals want the boxes that actions put down for good, by action and box."""
        self.action = -1
        self.side = 0
        """Of the pairs of sides that a grip which the action begins can close on, which one."""
        self.state: State = geometry.scene.state
        """Before the action."""
        self.after: State = self.state
        """After it."""
        self.lines: tuple[Line, ...] = ()
        """The straight ways of the action's motion."""
        self.acting: dict[str, ArmConfiguration] = {}
        """Configurations at the action's switch, by gripper."""
        self.added: list[ArmConfiguration] = []
        """Configurations whose surroundings have no rows yet."""

    def copy(self) -> "Context":
        """Another that goes on from here, after the same actions."""
        other = Context.__new__(Context)
        vars(other).update(vars(self))
        other.program = self.program.copy()
        for name in _GROWING:
            setattr(other, name, getattr(self, name).copy())
        return other

    def begin(self, after: State, lines: tuple[Line, ...], side: int) -> None:
        """Turn to the next action."""
        self.action += 1
        self.after, self.lines, self.side = after, lines, side
        self.before = dict(self.pose)
        self.choices.append([])

    def lines_of(self, gripper: str) -> tuple[Line, ...]:
        """The straight ways of a gripper in the action's motion."""
        return tuple(line for line in self.lines if line.gripper == gripper)

    def attach(self, body: str, parent: str) -> None:
        """The body hangs on another parent from now on: a gripper, or something to stand on."""
        held = self.held.pop(body, None)
        if held is not None:
            del self.hands[held.gripper]
        if parent in self.robot.arms:
            self.held[body] = self.hands[parent]

    def end(self) -> None:
        """The action is done: arms whose box carries nothing (any more) go to their side."""
        self.state = self.after
        self.standing = {
            gripper: configuration
            for gripper, configuration in self.standing.items()
            if (held := self.state.held_by(gripper)) is not None and self.level(held, self.state)
        }
        self.acting = {}

    def take_added(self) -> list[ArmConfiguration]:
        """The configurations that have been added since the last call."""
        added, self.added = self.added, []
        return added

    def level(self, held: str, state: State) -> bool:
        """Whether a hand keeps what it holds level."""
        return held in self.upright or bool(state.standing_on(held))

    # the mode tree

    def at_side(self, name: str) -> bool:
        """Whether a body is held by an arm at its side."""
        held = self.held.get(name)
        return held is not None and held.gripper not in self.standing

    def root(self, name: str) -> str:
        """What a body stands on in the end: itself, a surface or a held box."""
        support = self.state.support_of(name)
        return name if support is None else self.root(support)

    def top(self, name: str) -> float:
        """Height of a table's or standing box's top (m); the floor for what is held."""
        pose = self.pose[name]
        stands = self.state.holder(name) is None and pose.z == ZERO
        return pose.offset + self.half(name)[2] if stands else 0.0

    def half(self, name: str) -> tuple[float, float, float]:
        """Half extents (m) of a body."""
        return self.geometry.bodies[name].half

    def closed(self, gripper: str) -> float:
        """How far (m) each finger of a hand is from where it is when the hand is wide open."""
        held = self.hands.get(gripper)
        return 0.0 if held is None else held.closed

    def joints(self, gripper: str) -> tuple[int, ...]:
        """Where an arm is while it does not act."""
        standing = self.standing.get(gripper)
        return self.home[gripper] if standing is None else standing.joints

    def others(self, gripper: str) -> tuple[str, ...]:
        """The other grippers."""
        return tuple(other for other in self.robot.arms if other != gripper)

    def keyframe(self) -> KeyframeSlots:
        """Where everything is, the acting arms at their contact."""
        posed = self.standing | self.acting
        joints = {g: posed[g].joints if g in posed else None for g in self.robot.arms}
        boxes: dict[str, PlanarPose | HeldBox] = {}
        for name in self.geometry.boxes:
            held = self.held.get(name)
            at_side = held is not None and joints[held.gripper] is None
            boxes[name] = held if held is not None and at_side else self.pose[name]
        return KeyframeSlots(joints, boxes)

    # variables and rows

    def plane(self) -> tuple[int, int, int]:
        """Slots of a new x, y and yaw."""
        return (
            self.program.variable(-3.0, 3.0, 1e-3, 0.5),
            self.program.variable(-3.0, 3.0, 1e-3, 0.0),
            self.program.variable(-4 * np.pi, 4 * np.pi, 1e-4, 0.0),
        )

    def rows(
        self,
        kernel: str,
        inputs: Sequence[int],
        parameters: Sequence[float],
        names: tuple[str, ...],
        links: tuple[str, ...] = (),
        levers: Sequence[float] | None = None,
    ) -> None:
        """Add rows of a kernel to the program, for the action at hand."""
        self.program.rows(kernel, inputs, parameters, self.action, names, links, levers)

    def choose(self, choice: Start) -> None:
        """Leave something to the start."""
        self.choices[-1].append(choice)

    def arm_parameters(self, arm: ArmKinematics) -> tuple[float, ...]:
        """Parameters of an arm in kernels."""
        return arm.side, *self.fixed

    def _constant_pose(self, pose: tuple[float, float, float, float]) -> PlanarPose:
        x, y, yaw, z = pose
        constant = self.program.constant
        return PlanarPose(constant(x), constant(y), constant(yaw), ZERO, z)


_GROWING = (
    *("pose", "held", "hands", "standing", "acting", "added", "grips", "configurations", "choices"),
    *("balanced", "separated", "aims"),
)
"""What a context changes in place."""
