"""Carrying out a plan: what happens when, and what is found at the end."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import accumulate, pairwise
from types import TracebackType

import numpy as np

from guided_lgp.bounds.checks import Violation, box_bodies
from guided_lgp.bounds.execution.clock import stops_at
from guided_lgp.bounds.execution.conditions import AS_PLANNED, Conditions
from guided_lgp.bounds.execution.forces import grips_of
from guided_lgp.bounds.execution.hands import closing_rows, opening_rows
from guided_lgp.bounds.execution.noise import misplaced
from guided_lgp.bounds.execution.simulation import SETTLE_S, Simulation
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.geometry import grasp_faults
from guided_lgp.errors import InputError
from guided_lgp.logic import Goal, GroundAtom, Objective, Skeleton, State, successor
from guided_lgp.poses import compose, inverse
from guided_lgp.robots.hand_parts import parts_of
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World, initial_poses

GRASP_SLACK = 0.006
"""How far (m, rad) beyond the limits of verification a simulated grasp may be off ..."""
KNOCK = 0.005
"""How far (m) a hand may move what it is about to take."""
DROP = 0.003
"""How high (m) above its support a box may be let go of."""
DRIFT = 0.01
"""How far (m) a box may be from where the plan leaves it ..."""
DEVIATIONS = 4.0
"""... and how many standard deviations farther where arms misplace boxes. The same goes for grasps,
but their fingertips have to be on the box."""
UPRIGHT = 0.9
"""Least vertical part of the contact normals where a box stands on something."""
PLACE_SLACK = 0.005
"""How far (m, rad) a box or an arm may be off what a goal asks for: as it settles."""
HELD_SLACK = 0.02
"""How far (m) a held box may have slipped in the hand at the end."""


@dataclass(frozen=True)
class PhysicsReport:
    """Outcome of an execution."""

    success: bool
    """All goals hold in the settled world, and every box is where the plan leaves it."""
    goals: Mapping[str, bool] = field(default_factory=dict)
    """For each goal of the objective, written as ``(on red tab1)``, whether it holds."""
    drift: float = 0.0
    """Largest distance (m) of a box from where the plan leaves it."""
    fault: str = ""
    """What went wrong, if something did: ``hold pr2L red`` where the gripper missed the box."""


def execute(
    scene: Scene,
    objective: Objective,
    skeleton: Skeleton,
    trajectory: Trajectory,
    conditions: Conditions = AS_PLANNED,
) -> PhysicsReport:
    """Carry out a plan under gravity and read the goals from the settled world.

    Args:
        scene: the initial configuration.
        objective: the goals to look at.
        skeleton: the actions that the trajectory carries out.
        trajectory: the motion.
        conditions: how boxes are held, and what is not as planned.
    """
    with Execution(scene, conditions) as execution:
        fault = execution.carry_out(scene, skeleton, trajectory)
        if fault:
            return PhysicsReport(False, fault=fault)
        return execution.report(objective, final_boxes(scene, trajectory))


def final_boxes(scene: Scene, trajectory: Trajectory) -> dict[str, Array]:
    """Where a plan leaves every box: poses (7,), from the scene, the attachments and kinematics."""
    boxes = initial_poses(scene)
    arms = trajectory.joints(scene.robot.description.joint_names)
    for attachment in sorted(trajectory.attachments, key=lambda attachment: attachment.start):
        ends = arms[[attachment.start, attachment.end]]
        start, end = scene.robot.tool_poses(ends)[attachment.gripper]
        boxes[attachment.box] = compose(end, compose(inverse(start), boxes[attachment.box]))
    return boxes


class Execution:
    """A scene in which plans are carried out one after the other; leave it by ``with``."""

    def __init__(self, scene: Scene, conditions: Conditions = AS_PLANNED) -> None:
        self.state = scene.state
        """Who holds what and what stands where, by the actions so far."""
        self._scene, self._conditions = scene, conditions
        self._robot = scene.robot.description
        if conditions.grip == "friction":
            _require_fingers(scene)
        self._world = World(scene)
        self._simulation = Simulation(self._world, conditions)
        self._held: dict[tuple[str, str], tuple[int | None, Array]] = {}
        self._leaving: dict[tuple[str, str], list[str]] = {}
        """Links of hands that let go of a box and are not yet out of it."""
        self._seen = initial_poses(scene)
        self._amiss = DEVIATIONS * conditions.noise

    def __enter__(self) -> "Execution":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._world.close()

    def carry_out(self, scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> str:
        """Carry out a plan from where the world is now.

        Args:
            scene: that the plan starts from.
            skeleton: its actions.
            trajectory: its motion.

        Returns:
            What went wrong; empty if nothing did.
        """
        rows = switches_of(scene, skeleton, trajectory)
        if isinstance(rows, Violation):
            return rows.constraint
        noise, seed = self._conditions.noise, self._conditions.seed
        if noise:
            trajectory = misplaced(scene, skeleton, rows, trajectory, noise, seed)
        self._forces = {
            (grip.gripper, grip.box, grip.start): self._conditions.force or grip.force
            for grip in grips_of(scene, skeleton, rows, trajectory)
        }
        pressing = self._conditions.grip == "friction"
        taken = _rows_of_grasps(scene.state, skeleton, rows) if pressing else []
        self._simulation.load(trajectory, stops_at(self._robot, trajectory, taken))
        for box, gripper in sorted(scene.held.items()):
            if (gripper, box) not in self._held:
                self._reach(gripper, box)
                if fault := self._take(gripper, box, 0):
                    return fault
        self._simulation.rest(SETTLE_S)
        self._seen = self.boxes()
        for row, event in self._events(scene.state, skeleton, rows, trajectory):
            self._simulation.follow(float(trajectory.times[row]))
            if fault := event():
                return fault
        self._simulation.follow(float(trajectory.times[-1]))
        self._simulation.rest(SETTLE_S)
        return ""

    def report(self, objective: Objective, planned: Mapping[str, Array]) -> PhysicsReport:
        """What holds in the world as it is.

        Args:
            objective: the goals to look at.
            planned: where boxes should be: poses (7,).
        """
        goals = {
            str(goal): all(self._holds(a) for a in self.state.domain.conditions(goal))
            and self._in_place(goal)
            for goal in objective
        }
        boxes = self.boxes()
        drifts = {
            box: float(np.linalg.norm(boxes[box][:3] - planned[box][:3])) for box in sorted(boxes)
        }
        worst = max(drifts, key=lambda box: drifts[box])
        allowed = DRIFT + self._amiss
        fault = f"drift {worst}" if drifts[worst] >= allowed else ""
        return PhysicsReport(all(goals.values()) and not fault, goals, drifts[worst], fault)

    def boxes(self) -> dict[str, Array]:
        """Pose (7,) of every box."""
        return {box: self._simulation.box(box) for box in self._world.boxes}

    def joints(self) -> Array:
        """Values (n,) of the arms' joints (rad)."""
        return self._simulation.joints()

    def held(self) -> dict[str, str]:
        """Boxes that are in a hand, and in which."""
        return {box: gripper for gripper, box in sorted(self._held) if self._in_hand(gripper, box)}

    def put(self, box: str, placement: Array) -> None:
        """Move a box to a pose (7,), as somebody else might."""
        self._simulation.put(box, placement)
        self._simulation.rest(SETTLE_S)

    def _events(
        self, state: State, skeleton: Skeleton, rows: Sequence[int], trajectory: Trajectory
    ) -> Iterator[tuple[int, Callable[[], str]]]:
        """What happens at which row, in order: hands reach boxes, take them, let go and leave.

        At every row, fingers may have come clear of what they leave.
        """
        found: list[tuple[int, int, Callable[[], str]]] = [
            (row, -1, self._come_clear) for row in range(len(trajectory.times))
        ]
        last = dict.fromkeys(self._robot.grippers, 0)
        for index, (action, row) in enumerate(zip(skeleton, rows, strict=True)):
            before, state = state, successor(state, action)
            taken = sorted(set(state.held) - set(before.held))
            left = sorted(set(before.held) - set(state.held))
            for box, gripper in taken:
                at = closing_rows(self._robot.arms[gripper], trajectory, last[gripper], row)
                found.append((at, index, partial(self._reach, gripper, box)))
                found.append((row, index, partial(self._take, gripper, box, row)))
            for box, gripper in left:
                found.append((row, index, partial(self._let_go, gripper, box, state)))
                after = next((r for r in rows[index + 1 :] if r > row), len(trajectory.times) - 1)
                at = opening_rows(self._robot.arms[gripper], trajectory, row, after)
                found.append((at, index, partial(self._leave, gripper, box)))
            for _, gripper in (*taken, *left):
                last[gripper] = row
            found.append((row, index, partial(self._enter, state)))
        yield from ((row, event) for row, _, event in sorted(found, key=lambda e: e[:2]))

    def _enter(self, state: State) -> str:
        self.state = state
        return ""

    def _reach(self, gripper: str, box: str) -> str:
        """The open hand is at the box; its links may pass through it until it has left again."""
        seen, self._seen[box] = self._seen[box], self._simulation.box(box)
        parts = parts_of(self._robot, gripper)
        self._leaving.pop((gripper, box), None)
        fixed = self._conditions.grip == "fixed"
        links = self._robot.arms[gripper].hand_links if fixed else parts.between
        self._simulation.touch(links, box, allowed=False)
        pushed = float(np.linalg.norm(self._seen[box][:3] - seen[:3]))
        stands = self.state.support_of(box) in self._world.supports
        return f"knock {gripper} {box}" if stands and pushed > KNOCK else ""

    def _take(self, gripper: str, box: str, row: int) -> str:
        """The fingers have closed; a fault if they are not on the box."""
        tool, placement = self._simulation.tool(gripper), self._simulation.box(box)
        body, arm = box_bodies(self._scene)[box], self._robot.arms[gripper]
        for fault in grasp_faults(arm, box, body, placement.tolist(), tool.tolist()):
            pads = fault.constraint.startswith("pads ")
            if fault.amount > GRASP_SLACK + (0.0 if pads else self._amiss):
                return fault.constraint
        constraint = None
        if self._conditions.grip == "friction":
            self._simulation.squeeze(gripper, self._forces[gripper, box, row])
        else:
            in_palm = compose(inverse(self._simulation.palm(gripper)), placement)
            constraint = self._simulation.fix(gripper, box, in_palm)
        self._held[gripper, box] = constraint, compose(inverse(tool), placement)
        return ""

    def _let_go(self, gripper: str, box: str, after: State) -> str:
        """The fingers begin to open; a fault if the box is above what it should stand on."""
        self._release(gripper, box)
        self._seen[box] = self._simulation.box(box)  # for a hand that comes before this one leaves
        support = after.support_of(box)
        high = support is not None and self._world.distance(box, support, 2 * DROP) > DROP
        return f"stand {box} {support}" if high else ""

    def _release(self, gripper: str, box: str) -> None:
        """Nothing keeps the box in the hand any more."""
        constraint, _ = self._held.pop((gripper, box))
        if constraint is None:
            self._simulation.relax(gripper, box)
        else:
            self._simulation.free(constraint)

    def _leave(self, gripper: str, box: str) -> str:
        """The fingers are open: what touches the box from now on pushes it."""
        links, parts = self._robot.arms[gripper].hand_links, parts_of(self._robot, gripper)
        others = [link for link in links if link not in parts.between]
        self._simulation.touch(others, box, allowed=True)
        self._leaving[gripper, box] = list(parts.between)
        self._seen = self.boxes()
        return self._come_clear()

    def _come_clear(self) -> str:
        """Links whose hulls bridge the hollow of the fingers count once they are out of the box.

        Until then they would lift it, or throw it away.
        """
        for (_, box), links in self._leaving.items():
            clear = [link for link in links if self._world.distance(link, box, KNOCK) > 0]
            self._simulation.touch(clear, box, allowed=True)
            links[:] = [link for link in links if link not in clear]
        return ""

    def _holds(self, atom: GroundAtom) -> bool:
        """Whether a condition of a goal holds; what no contact shows, the state tells."""
        match atom.predicate, atom.symbols:
            case "held", (box,):
                seen = any(self._in_hand(gripper, box) for gripper, _ in self._held)
            case "holds", (gripper, box):
                seen = self._in_hand(gripper, box)
            case "on", (box, support):
                seen = self._rests(box, support)
            case _:
                return atom.holds_in(self.state)
        return seen != atom.negated

    def _in_place(self, goal: Goal) -> bool:
        """Whether boxes and arms are where a goal wants them, but for what settling may shift."""
        terms = GoalTerms.of((goal,), self._scene.symbols.domain)
        away = [fault.amount for fault in terms.faults(self._scene, self.boxes())]
        away += [self._away(gripper, end) for gripper, end in terms.ends.items()]
        return all(amount <= PLACE_SLACK for amount in away)

    def _away(self, gripper: str, end: Array) -> float:
        """How far (rad) a joint of an arm is at most from where it should end, at joints (n,)."""
        joints = self._simulation.joints()[self._robot.arms[gripper].slice]
        return float(np.abs(joints - end).max())

    def _in_hand(self, gripper: str, box: str) -> bool:
        """Whether a gripper holds a box that has not slipped."""
        if (gripper, box) not in self._held:
            return False
        _, grip = self._held[gripper, box]
        there = compose(self._simulation.tool(gripper), grip)[:3]
        return bool(np.linalg.norm(there - self._simulation.box(box)[:3]) < HELD_SLACK)

    def _rests(self, box: str, support: str) -> bool:
        """Whether a box that nothing holds is at rest upon a support."""
        if any(held == box for _, held in self._held):
            return False
        normals = self._simulation.normals(box, support)
        return bool(normals) and min(normals) > UPRIGHT


def _rows_of_grasps(state: State, skeleton: Skeleton, rows: Sequence[int]) -> list[int]:
    """At which hands have closed on what they take."""
    states = list(accumulate(skeleton, successor, initial=state))
    changes = zip(rows, pairwise(states), strict=True)
    return [row for row, (before, after) in changes if set(after.held) - set(before.held)]


def _require_fingers(scene: Scene) -> None:
    """Friction needs fingers that press.

    Raises:
        InputError: a hand has jaws that do not move.
    """
    for gripper, arm in scene.robot.description.arms.items():
        if not arm.fingers.joints:
            raise InputError("grip", f"{gripper} has no fingers that press", "fixed")
