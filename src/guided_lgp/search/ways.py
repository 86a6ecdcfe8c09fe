"""Where a body can get by what single arms can do, all other bodies aside."""

from collections.abc import Collection, Iterator
from itertools import permutations

from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.domains import extensions
from guided_lgp.logic import (
    Objective,
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    successor,
    unsatisfied,
)
from guided_lgp.logic.grounding import ground_instructions
from guided_lgp.logic.objectives import may_leave, parents_wanted_by
from guided_lgp.params import BoundsParams
from guided_lgp.scene import Scene


def widened_scene(
    scene: Scene, objective: Objective, params: BoundsParams, deadline: Deadline = NEVER
) -> Scene | None:
    """The scene with further instructions, where some goal cannot be reached without them.

    That is: the body has no way from arm to arm over furniture to where it should be, but with the
    instructions of a domain that extends that of the scene it has one.

    Raises:
        OutOfTimeError: the deadline has passed.
    """
    for body, wanted in _moves(scene, objective):
        if has_way(scene, body, wanted, params, deadline):
            continue
        for name in extensions(scene.domain):
            wider = scene.model_copy(update={"domain": name})
            if has_way(wider, body, wanted, params, deadline):
                return wider
    return None


def has_way(
    scene: Scene,
    body: str,
    wanted: frozenset[str],
    params: BoundsParams,
    deadline: Deadline = NEVER,
) -> bool:
    """Whether arms can bring a body to furniture or a gripper, alone in the scene.

    It goes over furniture and grippers; the coarse bound judges every sequence of actions.
    """
    lone, symbols = _alone(scene, body), scene.symbols
    bounds = SceneBounds(lone, params, deadline)
    moves = [
        one
        for one in ground_instructions(symbols)
        if one.body == body and one.parent not in symbols.movable
    ]
    ways: dict[str, Skeleton] = {scene.state.parent_of(body): ()}
    for parent in (queue := list(ways)):  # it grows on the way
        for one in moves:
            skeleton = (*ways[parent], one.action)
            if (
                one.parent not in ways
                and may_leave(parent, one.precondition, body, symbols)
                and bounds.coarse(skeleton).feasible
            ):
                ways[one.parent] = skeleton
                queue.append(one.parent)
                if one.parent in wanted:
                    return True
    return False


def _moves(scene: Scene, objective: Objective) -> Iterator[tuple[str, frozenset[str]]]:
    """The bodies that goals want on certain furniture or in a certain gripper."""
    for goal in unsatisfied(scene.state, objective):
        for body, wanted in parents_wanted_by(goal, scene.symbols).items():
            if wanted.isdisjoint((scene.state.parent_of(body), *scene.symbols.movable)):
                yield body, wanted


def _alone(scene: Scene, body: str) -> Scene:
    """The scene with one body, and those below it."""
    below = [body]
    while (support := scene.state.support_of(below[-1])) is not None:
        below.append(support)
    boxes = tuple(box for box in scene.boxes if box.fixed or box.name in below)
    return scene.model_copy(update={"boxes": boxes})


def ways_onto(
    support: str, bodies: Collection[str], state: State, symbols: Symbols
) -> Iterator[Skeleton]:
    """Ways to bring bodies onto a support one after the other, those that are there aside."""
    missing = sorted(set(bodies) - set(state.standing_on(support)))
    for order in permutations(missing):
        found: list[tuple[Skeleton, State]] = [((), state)]
        for body in order:
            found = [
                longer
                for way, now in found
                for longer in _brought(body, support, way, now, symbols)
            ]
        yield from (way for way, _ in found)


def _brought(
    body: str, support: str, way: Skeleton, state: State, symbols: Symbols
) -> Iterator[tuple[Skeleton, State]]:
    """A way, longer by the actions that bring a body onto a support."""
    for action in applicable_actions(state, symbols):
        one, after = symbols.domain.bind(action), successor(state, action)
        if one.body == body and one.parent == support:
            yield (*way, action), after
        elif one.body == body and one.into_hand and state.holder(body) is None:
            yield from _brought(body, support, (*way, action), after, symbols)
