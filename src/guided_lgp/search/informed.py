"""What is known of the geometry, and what it says about the actions that are still needed.

Knowledge is about boxes where they are at the start: what is in the way of taking them there. Once
a box has been moved, nothing is known about it.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Protocol

from guided_lgp.bounds.coarse.pairs import Pairs
from guided_lgp.bounds.coarse.parts import Boxes
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import (
    Action,
    Goal,
    Skeleton,
    State,
    applicable_actions,
    least_actions,
    unsatisfied,
)
from guided_lgp.logic.objectives import parents_wanted_by
from guided_lgp.logic.state import Fact
from guided_lgp.logic.strips import RelaxedOperator, facts, goal_facts, relaxed_operators
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Run
from guided_lgp.search.skeleton_tree import Node


class Knowledge(Protocol):
    """What a search knows, or has learnt, about a scene."""

    def blockers(self, action: Action) -> tuple[Boxes, ...]:
        """What makes an action impossible while it stands where it does at the start.

        Args:
            action: one that is applicable at the start.

        Returns:
            Sets of boxes, each of which suffices; an empty one: impossible in any case.
        """
        ...

    def denied(self, skeleton: Skeleton) -> bool:
        """Whether what is known makes the last action of a sequence impossible."""
        ...

    def learn(self, skeleton: Skeleton) -> None:
        """Note that a sequence is infeasible, and all of it but the last action is not."""
        ...


class NothingKnown:
    """What the searches of the paper's tables know."""

    def blockers(self, action: Action) -> tuple[Boxes, ...]:
        """See :class:`Knowledge`."""
        return ()

    def denied(self, skeleton: Skeleton) -> bool:
        """See :class:`Knowledge`."""
        return False

    def learn(self, skeleton: Skeleton) -> None:
        """See :class:`Knowledge`."""


class FactsOfPairs:
    """Facts of the coarse bound: verdicts on small parts of the scene, calls like any other.

    Those are asked for that estimates want; others would cost more calls than they save.
    """

    def __init__(self, problem: Problem, asked: Run | SceneBounds) -> None:
        self._pairs = Pairs(problem.scene, asked.coarse, asked.part)
        self._out_of_reach = problem.parts.out_of_reach
        self._asked: set[Action] = set()

    def blockers(self, action: Action) -> tuple[Boxes, ...]:
        """See :class:`Knowledge`."""
        if self._out_of_reach((action,)):
            return (Boxes(),)
        self._asked.add(action)
        return self._pairs.blockers(action)

    def denied(self, skeleton: Skeleton) -> bool:
        """See :class:`Knowledge`."""
        if self._out_of_reach(skeleton):
            return True
        return skeleton[-1] in self._asked and self._pairs.impossible(skeleton) is not None

    def learn(self, skeleton: Skeleton) -> None:
        """See :class:`Knowledge`; a failure adds nothing to the facts."""


class InformedLandmarks:
    """Landmark-cut with facts: admissible as far as the facts are true.

    To take a box for the first time needs something of every set of blockers to be *away*; to take
    it again needs the box itself to be away. Whatever moves a box makes it so.
    """

    def __init__(self, problem: Problem, knowledge: Knowledge) -> None:
        self._symbols, self._bind = problem.symbols, problem.symbols.domain.bind
        self._ways = _relevant(problem, knowledge)
        own = {Boxes({box}) for box in self._symbols.boxes}
        self._sets = sorted(own.union(*self._ways.values()) - {Boxes()}, key=sorted)
        operators = [
            informed
            for operator in relaxed_operators(self._symbols)
            for informed in self._informed(operator)
        ]
        goals = goal_facts(problem.objective, self._symbols)
        self._landmark_cut = LandmarkCut(goals, operators)
        self._known: dict[tuple[State, Boxes], float] = {}

    def __call__(self, node: Node) -> float:
        """Lower bound on the number of actions from a node on."""
        key = node.state, Boxes(self._bind(action).body for action in node.skeleton)
        if key not in self._known:
            holds = facts(node.state, self._symbols) | self._away(key[1])
            self._known[key] = self._landmark_cut(holds)
        return self._known[key]

    def _informed(self, operator: RelaxedOperator) -> Iterator[RelaxedOperator]:
        """An action at the start, where it is possible at all, and after its box was moved."""
        body = self._bind(operator.action).body
        additions = operator.additions | self._away(Boxes({body}))
        ways = self._ways.get(operator.action, ())
        if Boxes() not in ways:
            clear = frozenset(map(_fact, ways))
            yield RelaxedOperator(operator.action, operator.preconditions | clear, additions)
        if ways:
            again = operator.preconditions | {_fact(Boxes({body}))}
            yield RelaxedOperator(operator.action, again, additions)

    def _away(self, moved: Boxes) -> frozenset[Fact]:
        return frozenset(_fact(boxes) for boxes in self._sets if boxes & moved)


def _fact(boxes: Boxes) -> Fact:
    return "away", *sorted(boxes)


def _relevant(problem: Problem, knowledge: Knowledge) -> dict[Action, tuple[Boxes, ...]]:
    """What is in the way of what the goals speak of, of what is in the way of that, and so on."""
    start, ways = _actions_at_start(problem), {}
    for body in (queue := sorted(_named(problem, problem.objective))):  # it grows on the way
        for action in start.pop(body, ()):
            ways[action] = knowledge.blockers(action)
            queue += sorted(Boxes().union(*ways[action]))
    return ways


def _actions_at_start(problem: Problem) -> dict[str, list[Action]]:
    """The actions that are applicable at the start, by the box that they move."""
    found: dict[str, list[Action]] = {}
    for action in applicable_actions(problem.scene.state, problem.symbols):
        found.setdefault(problem.symbols.domain.bind(action).body, []).append(action)
    return found


def _named(problem: Problem, goals: Iterable[Goal]) -> set[str]:
    """The bodies that goals speak of."""
    return {body for goal in goals for body in parents_wanted_by(goal, problem.symbols)}


class ActionsNeeded:
    """A hand-made count of the actions still needed; it may be too high.

    Two for every box that is in the way of one that must move, directly or through others; one for
    every hand that holds such a box; and what the goals themselves need.
    """

    def __init__(self, problem: Problem, knowledge: Knowledge) -> None:
        self._problem, self._knowledge = problem, knowledge
        self._bind = problem.symbols.domain.bind
        self._start = _actions_at_start(problem)

    def __call__(self, node: Node) -> float:
        """The count from a node on; infinite if a box can never be taken."""
        symbols, objective = self._problem.symbols, self._problem.objective
        moved = {self._bind(action).body for action in node.skeleton}
        wanted = _named(self._problem, unsatisfied(node.state, objective))
        in_the_way = self._in_the_way(wanted, moved)
        if in_the_way is None:
            return math.inf
        in_hand = {body for body, _ in node.state.held} - _named(self._problem, objective)
        least = least_actions(node.state, objective, symbols)
        return least + 2 * len(in_the_way - wanted) + len(in_hand)

    def _in_the_way(self, wanted: set[str], moved: set[str]) -> set[str] | None:
        """What must make way for some boxes, themselves included; None if nothing helps."""
        found: set[str] = set()
        for body in (queue := sorted(wanted - moved)):  # it grows on the way
            if body in found:
                continue
            found.add(body)
            ways = self._fewest(body, moved)
            if ways is None:
                return None
            queue += sorted(ways)
        return found

    def _fewest(self, body: str, moved: set[str]) -> Boxes | None:
        """What is in the way of the hand for which that is the least."""
        choices = []
        for action in self._start.get(body, ()):
            ways = [boxes for boxes in self._knowledge.blockers(action) if not boxes & moved]
            if Boxes() not in ways:
                choices.append(Boxes().union(*ways))
        return min(choices, key=lambda boxes: (len(boxes), sorted(boxes)), default=None)
