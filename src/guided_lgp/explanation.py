"""Bounds for users: which constraint of which action stopped the sequences of a search."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from guided_lgp.bounds.coordination import Coordinator
from guided_lgp.bounds.coordination.law import SMOOTH
from guided_lgp.bounds.deadline import Deadline
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.path import Style
from guided_lgp.bounds.results import CoarseResult, Failure, PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.clearance import CLEARANCE, verify_apart
from guided_lgp.logic import Action, Objective, Skeleton, State, format_skeleton, progress
from guided_lgp.params import BoundsParams
from guided_lgp.scene import Scene
from guided_lgp.search.bounds import Bounds


@dataclass(frozen=True)
class Obstacle:
    """A constraint that stopped one or more sequences."""

    bound: str
    """``coarse``, or ``path`` for a sequence that the coarse bound had let pass."""
    constraint: str
    sequences: int
    """How many sequences it stopped."""
    example: Skeleton
    """The shortest of them, up to the action that the constraint belongs to."""
    violation: float
    """Of the example, in m or rad; NaN where there is no amount."""
    tried: str
    """What was tried for the example, in words."""

    @property
    def action(self) -> Action:
        """The action that the constraint belongs to."""
        return self.example[-1]

    def __str__(self) -> str:
        """What stopped the example; of a solver that found nothing, no more than that."""
        action = f"{format_skeleton(self.example)}: action {len(self.example)}"
        if self.bound == "coarse" and not math.isnan(self.violation):
            return f"{action} has no solution ({self.tried})"
        return f"{action}: {self.constraint} ({self.tried})"

    def document(self) -> dict[str, object]:
        """The JSON document of the obstacle."""
        return {
            "bound": self.bound,
            "action": str(self.action),
            "constraint": self.constraint,
            "violation": None if math.isnan(self.violation) else self.violation,
            "sequences": self.sequences,
            "example": [str(action) for action in self.example],
            "tried": self.tried,
        }


def users_bounds(
    scene: Scene,
    params: BoundsParams,
    deadline: Deadline,
    objective: Objective,
    coordinate: bool = False,
    in_order: bool = False,
    clearance: float = CLEARANCE,
) -> SceneBounds:
    """Bounds for a user's plan: jerk is limited, and grips hold firmly, where the scene does not
    give the grasps.

    Args:
        scene: the initial configuration.
        params: of the bounds.
        deadline: after which they give up.
        objective: whose terms motions keep.
        coordinate: whether all arms move at once where they can ...
        in_order: ... and no two actions may change places.
        clearance: m that motions keep from what they do not touch, where there is room.
    """
    firm = not any(box.grasps for box in scene.movable)
    goals = GoalTerms.of(objective, scene.symbols.domain)
    coordinator = Coordinator(scene, deadline, goals, in_order, clearance, verify_apart)
    shorten = coordinator.shorten if coordinate else None
    style = Style(firm, shorten, SMOOTH, clearance, verify_apart)
    return SceneBounds(scene, params, deadline, objective, style)


class ObservedBounds:
    """The bounds of a scene as one search uses them; keeps what stopped its sequences.

    Where a path has failed at an action, whatever goes on from there is put off: it would most
    likely fail again, after seconds. A search that has found nothing without it, takes it up.
    """

    def __init__(self, bounds: Bounds, placed: frozenset[str] = frozenset()) -> None:
        """Begin with nothing.

        Args:
            bounds: of the scene.
            placed: bodies whose last move goals ask more of than of others before it: where it
                fails, the body may still be moved once more.
        """
        self._bounds, self._placed = bounds, placed
        self._coarse: dict[Skeleton, CoarseResult] = {}
        self._path: dict[Skeleton, PathResult] = {}
        self._stuck: dict[Skeleton, Failure] = {}
        """Beginnings of sequences at whose last action a path has failed."""
        self._put_off = False

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """See :class:`guided_lgp.search.bounds.Bounds`."""
        if (failure := self._stuck_before(skeleton)) is not None:
            self._put_off = True
            return CoarseResult(skeleton, feasible=False, failure=failure, restarts=0)
        return self._coarse.setdefault(skeleton, self._bounds.coarse(skeleton))

    def path(self, skeleton: Skeleton) -> PathResult:
        """See :class:`guided_lgp.search.bounds.Bounds`."""
        if skeleton not in self._path:
            self._path[skeleton] = self._bounds.path(skeleton)
        result = self._path[skeleton]
        if result.failure is not None and not self._ends(skeleton, result.failure.action):
            self._stuck[skeleton[: result.failure.action + 1]] = result.failure
        return result

    def _ends(self, skeleton: Skeleton, index: int) -> bool:
        """Whether an action is the last move of a body of which goals ask more then."""
        later = {name for action in skeleton[index + 1 :] for name in action.symbols}
        return bool(self._placed.intersection(skeleton[index].symbols) - later)

    def take_up(self) -> bool:
        """Put nothing off that has been; whether there was something."""
        some, self._put_off = self._put_off, False
        self._stuck.clear()
        return some

    def _stuck_before(self, skeleton: Skeleton) -> Failure | None:
        beginnings = (skeleton[:length] for length in range(1, len(skeleton)))
        return next((self._stuck[part] for part in beginnings if part in self._stuck), None)

    @property
    def starts(self) -> int:
        """Starts of the coarse solver, over all sequences."""
        return sum(result.restarts for result in self._coarse.values())

    def obstacles(self, start: State, objective: Objective) -> tuple[Obstacle, ...]:
        """What stopped the sequences; first what is nearest to the objective.

        That is: where most goals hold after the action, by the logic alone; then what the path
        bound found, which looks at a sequence last; then what stopped most sequences.
        """
        groups: dict[tuple[str, Action, str], list[tuple[Skeleton, Failure]]] = {}
        for bound, skeleton, failure in self._failures():
            key = bound, skeleton[failure.action], failure.constraint
            groups.setdefault(key, []).append((skeleton[: failure.action + 1], failure))

        found = []
        for (bound, _, constraint), members in groups.items():
            example, failure = min(members, key=lambda member: (len(member[0]), _amount(member[1])))
            state = progress(start, example)
            goals = sum(state.satisfies(goal) for goal in objective)
            order = -goals, bound == "coarse", -len(members), len(example), _amount(failure)
            found.append(
                (
                    order,
                    Obstacle(
                        bound, constraint, len(members), example, failure.violation, failure.tried
                    ),
                )
            )
        return tuple(obstacle for _, obstacle in sorted(found, key=lambda pair: pair[0]))

    def _failures(self) -> Iterable[tuple[str, Skeleton, Failure]]:
        for bound, results in (("coarse", self._coarse), ("path", self._path)):
            for skeleton, result in results.items():
                if result.failure is not None:
                    yield bound, skeleton, result.failure


def _amount(failure: Failure) -> float:
    return math.inf if math.isnan(failure.violation) else failure.violation
