"""Every declared instruction and goal type through all layers, found by the registry alone."""

from collections import deque
from collections.abc import Iterator

import pytest

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.domains import domain_names, load_domain
from guided_lgp.logic import Skeleton, applicable_actions, progress, validate_objective
from guided_lgp.logic.grounding import all_goals, ground_instructions
from guided_lgp.logic.pddl import domain_text
from guided_lgp.logic.strips import goal_facts, relaxed_operators
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene, generate

INSTRUCTIONS = [
    (domain, one.name) for domain in domain_names() for one in load_domain(domain).instructions
]
GOAL_TYPES = [
    (domain, one.name) for domain in domain_names() for one in load_domain(domain).goal_types
]
MAX_LENGTH = 4


def scene_of(domain: str) -> Scene:
    return generate("a", 1, 77, "every").scenes[0].model_copy(update={"domain": domain})


def skeletons_with(scene: Scene, instruction: str) -> Iterator[Skeleton]:
    """Sequences that end with the first action of the instruction, short ones first."""
    queue: deque[Skeleton] = deque([()])
    while queue:
        skeleton = queue.popleft()
        if len(skeleton) < MAX_LENGTH:
            for action in applicable_actions(progress(scene.state, skeleton), scene.symbols):
                if action.instruction == instruction:
                    yield (*skeleton, action)
                else:
                    queue.append((*skeleton, action))


@pytest.mark.parametrize(("domain", "instruction"), INSTRUCTIONS)
def test_an_instruction_is_grounded_exported_and_moved(domain: str, instruction: str) -> None:
    scene = scene_of(domain)
    ground = [one.action for one in ground_instructions(scene.symbols)]
    assert any(action.instruction == instruction for action in ground)
    assert [operator.action for operator in relaxed_operators(scene.symbols)] == ground
    assert f"(:action {instruction}\n" in domain_text(scene.symbols.domain)

    bounds = SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds)
    feasible = (s for s in skeletons_with(scene, instruction) if bounds.coarse(s).feasible)
    found = next(feasible, None)
    assert found is not None, f"no keyframes with {instruction}"
    plan = bounds.path(found)
    assert plan.feasible, plan.failure


@pytest.mark.parametrize(("domain", "kind"), GOAL_TYPES)
def test_a_goal_type_is_grounded_and_can_be_asked_for(domain: str, kind: str) -> None:
    scene = scene_of(domain)
    goals = [goal for goal in all_goals(scene.symbols) if goal.kind == kind]
    wanted = next(goal for goal in goals if not scene.state.satisfies(goal))
    validate_objective((wanted,), scene.symbols, scene.state)
    assert goal_facts((wanted,), scene.symbols)
