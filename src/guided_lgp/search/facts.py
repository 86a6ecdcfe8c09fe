"""What is known to be impossible before any search."""

from collections.abc import Iterator

from guided_lgp.bounds.coarse.facts import Facts
from guided_lgp.logic import Objective, applicable_actions, unsatisfied
from guided_lgp.logic.grounding import ground_instructions
from guided_lgp.logic.objectives import parents_wanted_by
from guided_lgp.scene import Scene


def out_of_reach(scene: Scene, facts: Facts, objective: Objective) -> str | None:
    """Why a goal cannot be reached by any sequence of actions, in words; None if nothing is known.

    A body that no arm can grasp where it stands, on furniture, stays there; and furniture on which
    no arm can put a body never carries it.
    """
    found = next(_unreachable(scene, facts, objective), None)
    return None if found is None else f"{found} is out of reach of {_arms(scene)}"


def _unreachable(scene: Scene, facts: Facts, objective: Objective) -> Iterator[str]:
    for goal in unsatisfied(scene.state, objective):
        for body, parents in parents_wanted_by(goal, scene.symbols).items():
            if scene.state.parent_of(body) in parents:
                continue
            if _stuck(scene, facts, body):
                yield body
            if _denied(scene, facts, body, parents):
                yield " and ".join(sorted(parents))


def _stuck(scene: Scene, facts: Facts, body: str) -> bool:
    """Whether no arm can move a body from the furniture that it stands on."""
    bind = scene.symbols.domain.bind
    actions = applicable_actions(scene.state, scene.symbols)
    moves = [action for action in actions if bind(action).body == body]
    on_furniture = scene.state.support_of(body) in scene.symbols.surfaces
    return on_furniture and all(facts.impossible((action,)) for action in moves)


def _denied(scene: Scene, facts: Facts, body: str, parents: frozenset[str]) -> bool:
    """Whether all parents are furniture on which no arm can put a body."""
    symbols = scene.symbols
    ways = [
        one for one in ground_instructions(symbols) if one.body == body and one.parent in parents
    ]
    return parents <= set(symbols.surfaces) and all(facts.never(one) for one in ways)


def _arms(scene: Scene) -> str:
    arms = scene.symbols.grippers
    return {1: "the arm", 2: "both arms"}.get(len(arms), f"all {len(arms)} arms")
