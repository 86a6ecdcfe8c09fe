"""What all ways to carry out the actions of a skeleton share, and the arm's reach at a contact."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import permutations

import numpy as np

from guided_lgp.bounds.checks import closing_axis
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.path.grips import Grips
from guided_lgp.bounds.path.motions import Motion, Mover, Pair, Surroundings, Tool, Transit
from guided_lgp.bounds.path.situation import Situation, Step, situation_at_start, tool_pose
from guided_lgp.bounds.path.steps import manoeuvre
from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.bounds.verify.efforts import Load, overloads
from guided_lgp.logic import Skeleton, successor
from guided_lgp.poses import compose, pose
from guided_lgp.robots import PlacedArm
from guided_lgp.scene import Scene

_SHIFTS = (0.0, 0.25, -0.25, 0.5, -0.5)
"""Turns of the redundant joint (rad) on the straight way off a box that are tried."""

_KEPT = 16
"""How many inverse kinematics are kept of contacts asked for last, a few MB each: to keep all takes
half a GB in some searches and saves no time in any of 109."""

_AT_TOOL = np.zeros(3)
"""Where loads are in the tool frame, but for a few cm."""

_Key = tuple[str | bytes, ...]

Choice = tuple[int, int, int]
"""Tool pose, value of the redundant joint, branch of the inverse kinematics."""


class Stage(IntEnum):
    """How far an action had come when an obstacle was met."""

    START = -1
    """The arms go to their side from where they start."""
    REACH = 0
    CONTACT = 1
    OFF = 2
    """Where the straight way in begins."""
    LEFT = 3
    """Where the straight way out ends, as foreseen by an earlier action."""
    LINE_IN = 4
    LINE_OUT = 5
    OUT = 6
    """Where the straight way out ends."""
    TRANSIT = 7
    HOME = 8
    ASIDE = 9
    """An arm that nobody needs any more goes home."""
    END = 10
    """Arms go where goals want them."""
    VERIFICATION = 11


@dataclass(frozen=True)
class Outcome:
    """One way to carry out an action."""

    steps: tuple[Step, ...]
    situation: Situation
    contact: Keyframe


@dataclass
class FurthestFailure:
    """The obstacle met farthest on the way through the skeleton."""

    action: int = -1
    stage: int = -1
    constraint: str = "no motion found"
    tried: int = 0
    """Coarse solutions so far."""

    def record(self, action: int, stage: Stage, constraint: str) -> None:
        """Remember the obstacle unless one as far on is known."""
        if (action, stage) > (self.action, self.stage):
            self.action, self.stage, self.constraint = action, stage, constraint


@dataclass(frozen=True)
class IkSolutions:
    """Configurations of an arm for N tool poses at a contact and off it."""

    rotation: Array
    """(N, 3, 3) of the tool frame."""
    contact: Array
    """(N, 3) origin of the tool frame (m)."""
    way: Array
    """(N, 3) from the contact to where the tool is off it (m)."""
    q: Array
    """(N, 2, R, B, n): at the contact and off it, by redundant joint and branch; zeros where none
    is at the contact."""
    redundancies: Array
    """(R,) values of the redundant joint (rad)."""
    cost: Array
    """(N, R, B): distance of the second from the home posture; infinite out of reach."""

    def tool(self, choice: Choice) -> Tool:
        """The tool at the contact."""
        number, value, branch = choice
        redundancy = float(self.redundancies[value])
        return Tool(self.rotation[number], self.contact[number], redundancy, branch)

    def chosen(self, choices: Sequence[Choice]) -> Array:
        """Configurations (m, 2, n) at the contact and off it."""
        number, value, branch = np.array(choices, dtype=int).reshape(-1, 3).T
        return self.q[number, :, value, branch]

    def order(self, extra: Array | float = 0.0) -> list[Choice]:
        """All configurations within reach, cheapest first; ``extra`` (N,) is added to the cost."""
        cost = self.cost + np.reshape(extra, (-1, 1, 1))
        flat = np.argsort(cost, axis=None, kind="stable")
        flat = flat[: int(np.isfinite(cost).sum())]
        return [
            (int(n), int(p), int(s)) for n, p, s in np.transpose(np.unravel_index(flat, cost.shape))
        ]


@dataclass
class Culprits:
    """What the obstacles that an action met since it was begun depend on."""

    symbols: set[str] = field(default_factory=set)
    """Bodies by where they are, grippers by the posture of their arm."""
    anything: bool = False
    """Whether one of them may depend on all that came before: no motion was found."""


class Task:
    """One skeleton near one coarse solution, for the search through its actions."""

    def __init__(
        self,
        scene: Scene,
        mover: Mover,
        grips: Mapping[tuple[str, str], Mapping[float, tuple[Grips, Grips]]],
        skeleton: Skeleton,
        contacts: Sequence[Keyframe],
        failure: FurthestFailure,
        seed: int,
        goals: GoalTerms,
        overhung: Collection[str] = (),
        firm: bool = False,
    ) -> None:
        self.mover = mover
        self.arms = mover.arms
        domain = scene.symbols.domain
        self.manoeuvres = [manoeuvre(domain.bind(action)) for action in skeleton]
        self.contacts = contacts
        self.failure = failure
        self.goals = goals
        self.overhung = overhung
        """What may be stood on and is, in part, below something else."""
        self.firm = firm
        """Whether grips should hold what hands carry."""
        self.scene = scene
        self.rng = np.random.default_rng(np.random.SeedSequence([7, seed]))
        self.boxes = {box.name: box for box in scene.movable}
        self.supports = {body.name: body for body in scene.supports}
        self.grips = grips
        self.states = [scene.state]
        for action in skeleton:
            self.states.append(successor(self.states[-1], action))
        self.start = situation_at_start(scene, goals.upright)
        self.culprits = Culprits()
        """Of the action begun last."""
        self._kept: dict[_Key, IkSolutions] = {}

    def __len__(self) -> int:
        return len(self.manoeuvres)

    def next_move(self, index: int) -> int | None:
        """The next action on the body of one."""
        bodies = [manoeuvre.body for manoeuvre in self.manoeuvres]
        return next((j for j in range(index + 1, len(self)) if bodies[j] == bodies[index]), None)

    def root(self, index: int, body: str) -> str:
        """The lowest body below one, or that itself, before an action."""
        while (support := self.states[index].support_of(body)) is not None:
            body = support
        return body

    def suits(self, index: int, place: Array, boxes: Mapping[str, Array]) -> bool:
        """Whether goals allow the place (7,) where an action puts its body down for good."""
        body = self.manoeuvres[index].body
        if not self.goals.final or self.next_move(index) is not None:
            return True
        return not self.goals.about(body).faults(self.scene, {**boxes, body: place})

    def below(self, index: int, body: str) -> set[str]:
        """A body and those below it, before an action: where they are says where it is."""
        found = {body}
        while (support := self.states[index].support_of(body)) is not None:
            body = support
            found.add(body)
        return found

    def carrier(self, index: int, body: str) -> str | None:
        """The gripper that holds a body, or what the body stands on, before an action."""
        return self.states[index].holder(self.root(index, body))

    def solutions(
        self, index: int, arm: PlacedArm, rotation: Array, contact: Array, way: Array
    ) -> IkSolutions:
        """Solve the inverse kinematics of N tool poses at the contact and off it.

        An action is begun in many situations, most of which leave its contacts where they were.
        """
        coarse = arm.redundancy(self.contacts[index].q[arm.arm.slice])
        values = np.append(arm.redundancies, coarse)
        arrays = (values, rotation, contact, way)
        key: _Key = (arm.gripper, *(array.tobytes() for array in arrays))
        found = self._kept.pop(key, None) or self._solved(arm, rotation, contact, way, values)
        self._kept[key] = found  # now the last one
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return found

    @staticmethod
    def _solved(
        arm: PlacedArm, rotation: Array, contact: Array, way: Array, values: Array
    ) -> IkSolutions:
        at, within = arm.inverse(rotation[:, None], contact[:, None], values)
        pose, value = np.nonzero(within.any(axis=-1))  # few: only these are looked at off it
        off, valid = arm.inverse(rotation[pose], (contact + way)[pose], values[value])
        q = np.zeros((len(at), 2, *at.shape[1:]))
        q[pose, 0, value], q[pose, 1, value] = at[pose, value], off
        within[pose, value] &= valid
        cost = np.full(within.shape, np.inf)
        from_home = (q[:, 1][within] - arm.arm.home) * arm.arm.metric
        cost[within] = np.linalg.norm(from_home, axis=-1)
        return IkSolutions(rotation, contact, way, q, values, cost)

    def level_solutions(
        self, solutions: IkSolutions, gripper: str, situation: Situation
    ) -> IkSolutions:
        """What a level motion can reach: the branch stays; the nearest first."""
        arm, now = self.arms[gripper], situation.q[self.arms[gripper].arm.slice]
        way = (arm.near(solutions.q[:, 1], now) - now) * arm.arm.metric
        same = np.isfinite(solutions.cost)
        same[..., np.arange(same.shape[-1]) != arm.branch(now)] = False
        return replace(solutions, cost=np.where(same, np.linalg.norm(way, axis=-1), np.inf))

    def shifts(self, gripper: str) -> tuple[float, ...]:
        """Turns of an arm's redundant joint on a straight way off that are worth a try."""
        return _SHIFTS[:1] if self.arms[gripper].arm.redundant is None else _SHIFTS

    def transit(
        self, surroundings: Surroundings, start: Array, goal: Array, keep_level: bool
    ) -> list[Motion] | None:
        """A free motion to joints ``goal`` (n,), with rests at some corners, or None."""
        plan = self.mover.level_transit if keep_level else self.mover.transit
        paths = plan(surroundings, start, goal, self.rng)
        arm, transit = self.arms[surroundings.scene.gripper].arm, Transit(surroundings, keep_level)
        return None if paths is None else [Motion(arm, path, transit) for path in paths]

    def home(self, situation: Situation, gripper: str) -> list[Motion] | None:
        """A free motion of an arm to its side; none where it carries a stack, or is there."""
        arm = self.arms[gripper].arm
        now = situation.q[arm.slice]
        if situation.loaded(gripper) or np.array_equal(now, arm.home):
            return []
        return self.transit(situation.around(gripper), now, arm.home, keep_level=False)

    def gathered(self) -> tuple[list[Motion], Situation] | None:
        """All arms go to their side from where they start."""
        gathered = self._in_some_order(self.start, self.arms, self.home)
        if gathered is None:
            self.record(0, Stage.START, "no way from the start to the arms' side")
        return gathered

    def arrived(self, situation: Situation) -> tuple[list[Motion], Situation] | None:
        """Arms go where goals want them at the end."""
        arrived = self._in_some_order(situation, self.goals.ends, self._to_end)
        if arrived is None:
            self.record(len(self) - 1, Stage.END, "no motion found to the posture at the end")
        return arrived

    def _to_end(self, situation: Situation, gripper: str) -> list[Motion] | None:
        now, end = situation.q[self.arms[gripper].arm.slice], self.goals.ends[gripper]
        if np.array_equal(now, end):
            return []
        loaded = situation.loaded(gripper)
        return self.transit(situation.around(gripper), now, end, keep_level=loaded)

    def _in_some_order(
        self,
        situation: Situation,
        grippers: Iterable[str],
        move: Callable[[Situation, str], list[Motion] | None],
    ) -> tuple[list[Motion], Situation] | None:
        """Arms move, one after the other, in an order in which they can."""
        for order in permutations(grippers):
            steps, now = list[Motion](), situation
            for gripper in order:
                motions = move(now, gripper)
                if motions is None:
                    break
                steps += motions
                now = self.after(now, motions)
            else:
                return steps, now
        return None

    def after(self, situation: Situation, steps: Sequence[Step]) -> Situation:
        """The situation after steps."""
        for step in steps:
            situation = situation.after(step, self.arms)
        return situation

    def top(self, table: str, boxes: Mapping[str, Array]) -> Array:
        """Pose (7,) of the top of a table or box."""
        if table in self.supports:
            return pose(self.supports[table].top, self.supports[table].yaw)
        return compose(boxes[table], pose((0, 0, self.boxes[table].size[2] / 2)))

    def rest(self, support: str) -> Array:
        """Half extents (2,) of the part of a support's top that may carry (m)."""
        return np.array((self.supports | self.boxes)[support].convex.rest)

    def half(self, box: str) -> Array:
        """Half extents (2,) of a box seen from above (m)."""
        return np.array(self.boxes[box].convex.half[:2])

    def width(self, gripper: str, body: str, q: Array, boxes: Mapping[str, Array]) -> float:
        """Width (m) of a body between the fingers of a gripper at a configuration (n,)."""
        tool = tool_pose(self.arms[gripper], q).tolist()
        across = closing_axis(boxes[body].tolist(), tool)
        return self.boxes[body].size[across]

    def widths(self, index: int) -> list[float]:
        """Widths (m) on which fingers can close on the body of an action, the coarse one first."""
        action, contact = self.manoeuvres[index], self.contacts[index]
        assert action.closing is not None
        coarse = self.width(action.closing, action.body, contact.q, contact.boxes)
        grips = self.grips[action.closing, action.body]
        return sorted(grips, key=lambda width: (width != coarse, width))

    def opened(self, gripper: str, width: float) -> float:
        """The value of a gripper's fingers at which they are open around a width (m)."""
        return self.arms[gripper].arm.fingers.value_around(width)

    def record(self, index: int, stage: Stage, constraint: str) -> None:
        """Remember an obstacle of an action."""
        self.failure.record(index, stage, constraint)

    def unmoved(self, index: int, stage: Stage, constraint: str) -> None:
        """Remember that no motion was found, whatever stood in its way."""
        self.culprits.anything = True
        self.record(index, stage, constraint)

    def collided(self, index: int, stage: Stage, pair: Pair, where: str) -> None:
        """Remember two bodies in collision."""
        self.culprits.symbols |= {self.mover.symbol_of(name) for name in pair}
        self.record(index, stage, f"{self.mover.name_of(pair)} {where}")

    def blocked(
        self, index: int, stage: Stage, where: str, surroundings: Surroundings, q: Array
    ) -> bool:
        """Whether configurations (m, n) of the moving arm collide, and remember it."""
        return self.met(index, stage, where, self.mover.collision(surroundings, q))

    def met(self, index: int, stage: Stage, where: str, pair: Pair | None) -> bool:
        """Whether two bodies collide, and remember it."""
        if pair is not None:
            self.collided(index, stage, pair, where)
        return pair is not None

    def overloaded(self, index: int, situation: Situation, q: Array) -> bool:
        """Whether motors of the acting arm are too weak to rest at configurations (m, n) with the
        body in the hand, and remember it.
        """
        action = self.manoeuvres[index]
        bodies = (action.body, *self.states[index].carried_by(action.body))
        loads = [Load(action.gripper, body, _AT_TOOL) for body in bodies]
        whole = np.tile(situation.q, (len(q), 1))
        whole[:, self.arms[action.gripper].arm.slice] = q
        faults = overloads(self.scene, whole, loads)
        if faults:
            self.record(index, Stage.REACH, faults[0].constraint)
        return bool(faults)
