"""Every declared instruction, goal type, robot, planner and policy, walked through every layer.

The first half shows that each layer has a part for each declaration; the second takes parts away,
and asks for a message that names what is missing.
"""

from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from guided_lgp.bounds import coarse
from guided_lgp.bounds.coarse import check_terms
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.path import check_motions, steps
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.terms import kernel_table, term_names
from guided_lgp.cli import STAGES
from guided_lgp.domains import domain_names, load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    Domain,
    Goal,
    Skeleton,
    applicable_actions,
    parse_objective,
    progress,
    satisfied,
    successor,
)
from guided_lgp.logic.grounding import all_goals, ground_instructions
from guided_lgp.logic.pddl import domain_text, problem_text
from guided_lgp.logic.strips import goal_facts, relaxed_operators
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.policy.registry import (
    POLICIES,
    TRAINED_POLICIES,
    load_policy,
    missing_instructions,
)
from guided_lgp.robots import load_robot, robot_names
from guided_lgp.scene import PlacedRobot, Scene, generate
from guided_lgp.scene.world import World
from guided_lgp.search import planners
from guided_lgp.search.observation import observe, start
from guided_lgp.search.planners import PLANNERS, SEARCHES, check_planners

ROBOTS = SOURCES / "src" / "guided_lgp" / "robots"
INSTRUCTIONS = [
    (name, instruction.name)
    for name in domain_names()
    for instruction in load_domain(name).instructions
]
GOAL_TYPES = [
    (name, goal_type.name) for name in domain_names() for goal_type in load_domain(name).goal_types
]
FURTHER_GOALS = [
    (name, goal_type.name)
    for name in domain_names()
    for goal_type in load_domain(name).further_goals
]


def scene_of(domain: str) -> Scene:
    return generate("a", 1, 77, "walk").scenes[0].model_copy(update={"domain": domain})


def shortest_ending_with(name: str, scene: Scene) -> Skeleton:
    """The first skeleton, breadth-first, whose last action is of an instruction."""
    skeletons: deque[Skeleton] = deque([()])
    while True:
        skeleton = skeletons.popleft()
        for action in applicable_actions(progress(scene.state, skeleton), scene.symbols):
            if action.instruction == name:
                return (*skeleton, action)
            skeletons.append((*skeleton, action))


def bounds_of(scene: Scene) -> SceneBounds:
    return SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds)


@pytest.mark.parametrize(("domain", "name"), INSTRUCTIONS)
def test_the_logic_serves_every_instruction(domain: str, name: str) -> None:
    scene = scene_of(domain)
    skeleton = shortest_ending_with(name, scene)
    before = progress(scene.state, skeleton[:-1])
    action = skeleton[-1]
    assert action in applicable_actions(before, scene.symbols)
    assert Action.parse(str(action)) == action
    ground = scene.symbols.domain.bind(action)
    assert successor(before, action).parent_of(ground.body) == ground.parent
    assert f"(:action {name}" in domain_text(scene.symbols.domain)
    every = [one.action for one in ground_instructions(scene.symbols)]
    assert action in every
    assert [operator.action for operator in relaxed_operators(scene.symbols)] == every


@pytest.mark.parametrize(("domain", "name"), INSTRUCTIONS)
def test_the_bounds_and_physics_serve_every_instruction(domain: str, name: str) -> None:
    skeleton = shortest_ending_with(name, scene_of(domain))
    scene, trajectory = carried_out(domain, skeleton)
    goals = tuple(
        goal
        for goal in all_goals(scene.symbols)
        if goal.symbols[0] == skeleton[0].symbols[1]
        and satisfied(progress(scene.state, skeleton), (goal,))
    )
    report = execute(scene, goals, skeleton, trajectory)
    assert goals
    assert report.success, report


def carried_out(domain: str, skeleton: Skeleton) -> tuple[Scene, Trajectory]:
    """The first of some scenes in which a skeleton has a verified path, and that path."""
    for scene in generate("a", 8, 77, "walk").scenes:
        own = scene.model_copy(update={"domain": domain})
        result = bounds_of(own).path(skeleton)
        if result.trajectory is not None:
            return own, result.trajectory
    raise AssertionError(f"{skeleton} has no path in any scene")


@pytest.mark.parametrize(("domain", "name"), GOAL_TYPES)
def test_every_layer_serves_every_goal_type(domain: str, name: str) -> None:
    scene = scene_of(domain)
    goals = [goal for goal in all_goals(scene.symbols) if goal.kind == name]
    assert goals
    for goal in goals:
        assert Goal.parse(str(goal)) == goal
        assert parse_objective([str(goal)]) == (goal,)
        assert scene.symbols.domain.conditions(goal)
        assert goal_facts((goal,), scene.symbols)
        assert problem_text(scene.state, (goal,), scene.symbols)


@pytest.mark.parametrize("name", POLICIES)
@pytest.mark.parametrize("domain", domain_names())
def test_a_policy_scores_every_instruction_or_names_those_it_cannot(domain: str, name: str) -> None:
    scene, policy = scene_of(domain), load_policy(name)
    learnt = {instruction.name for instruction in load_domain().instructions}
    own = [instruction.name for instruction in scene.symbols.domain.instructions]
    missing = tuple(i for i in own if i not in learnt and name in TRAINED_POLICIES)
    assert missing_instructions(policy, scene.symbols.domain) == missing
    actions = applicable_actions(scene.state, scene.symbols)
    positions = observe(scene, start(scene))
    objective = parse_objective(["(held red)"])
    scores = policy.log_probabilities(objective, scene.state, scene.symbols, positions, actions)
    assert scores.shape == (len(actions),)
    assert np.exp(scores).sum() == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("name", POLICIES)
def test_every_policy_has_its_stage_and_its_colour(name: str) -> None:
    declared = POLICIES[name]
    assert declared.stage in STAGES or not declared.networks
    assert declared.label
    assert declared.summary
    assert len({policy.color for policy in POLICIES.values()}) == len(POLICIES)


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_has_its_search_its_policy_and_its_looks(name: str) -> None:
    planner = PLANNERS[name]
    assert planner.search in SEARCHES
    assert not planner.policy or planner.policy in POLICIES
    assert planner.color or planner.policy in POLICIES
    looks = [(p.label, p.search, p.policy, p.adapt) for p in PLANNERS.values()]
    assert looks.count((planner.label, planner.search, planner.policy, planner.adapt)) == 1


@pytest.mark.parametrize("name", robot_names())
def test_every_layer_serves_every_robot(name: str) -> None:
    robot = load_robot(name)
    scene = scene_of("pick_and_place").model_copy(update={"robot": PlacedRobot(model=name)})
    assert scene.symbols.grippers == robot.grippers
    chains = kinematics_of(robot).chains
    names = {kernel.name for kernel in kernel_table(kinematics_of(robot))}
    assert {f"hold_{chain.name}" for chain in chains} <= names
    with World(scene) as world:
        world.set(robot.home, {})
        tools = world.link_poses([robot.arms[gripper].tool_link for gripper in robot.grippers])
    known = scene.robot.link_poses(
        robot.home[None], [robot.arms[gripper].tool_link for gripper in robot.grippers]
    )[0]
    np.testing.assert_allclose(tools[:, :3], known[:, :3], atol=1e-5)


# a part less


@pytest.mark.parametrize("term", term_names())
def test_a_missing_term_is_named_with_its_instruction(
    term: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = tuple(name for name in term_names() if name != term)
    monkeypatch.setattr(coarse.formulation, "term_names", lambda: others)
    for name in domain_names():
        domain = load_domain(name)
        users = [i.name for i in domain.instructions if term in [t.name for t in i.contact]]
        if users:
            fault = rf"{name}\.py: instruction {users[0]}, contact: {term}"
            with pytest.raises(InputError, match=fault):
                check_terms(domain)


@pytest.mark.parametrize("step", steps.STEPS)
def test_a_missing_step_is_named_with_its_instruction(
    step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(steps, "STEPS", tuple(name for name in steps.STEPS if name != step))
    for name in domain_names():
        domain = load_domain(name)
        users = [i.name for i in domain.instructions if step in [s.name for s in i.motion]]
        if users:
            with pytest.raises(InputError, match=f"{users[0]}.*{step}"):
                check_motions(domain)


def without(parts: tuple[Any, ...]) -> list[tuple[Any, ...]]:
    """The parts but for one, for each of them."""
    return [parts[:number] + parts[number + 1 :] for number in range(len(parts))]


def instead(domain: Domain, one: Any, other: Any) -> Domain:
    """The domain with another declaration in place of one."""
    lists = ("instructions", "goal_types", "further_goals")
    changed = {
        name: tuple(other if known == one else known for known in getattr(domain, name))
        for name in lists
    }
    return replace(domain, extends=None, **changed)


@pytest.mark.parametrize(("domain", "name"), INSTRUCTIONS)
def test_an_instruction_without_one_of_its_parts_is_named(domain: str, name: str) -> None:
    """Its parameters, its effect, what it says of its hand, and the steps of every motion."""
    declared = load_domain(domain)
    one = next(one for one in declared.instructions if one.name == name)
    steps_of_all = ("transit", "line_in", "switch", "line_out")
    motions = [tuple(term for term in one.motion if term.name != step) for step in steps_of_all]
    less = [
        *(replace(one, parameters=parameters) for parameters in without(one.parameters)),
        replace(one, effect=()),
        replace(one, precondition=one.precondition[1:]),
        *(replace(one, motion=motion) for motion in motions),
    ]
    for changed in less:
        with pytest.raises(InputError, match=rf"{domain}\.py: instruction {name}, \w+"):
            check_motions(instead(declared, one, changed))


@pytest.mark.parametrize(("domain", "name"), [*GOAL_TYPES, *FURTHER_GOALS])
def test_a_goal_type_without_one_of_its_parts_is_named(domain: str, name: str) -> None:
    """Its parameters and its numbers; its condition, where that is all it has."""
    declared = load_domain(domain)
    every = (*declared.goal_types, *declared.further_goals)
    one = next(one for one in every if one.name == name)
    less = [
        *(replace(one, parameters=parameters) for parameters in without(one.parameters)),
        *(replace(one, numbers=numbers) for numbers in without(one.numbers)),
        replace(one, condition=(), final=(), lasting=()),
    ]
    for changed in less:
        with pytest.raises(InputError, match=rf"{domain}\.py: goal type {name}, \w+"):
            check_terms(instead(declared, one, changed))


@pytest.mark.parametrize("policy", POLICIES)
def test_a_missing_policy_is_named_with_its_planner(policy: str) -> None:
    planner = next(planner for planner in PLANNERS.values() if planner.policy == policy)
    with pytest.raises(InputError, match=f"planner {planner.name}, policy: {policy!r} is unknown"):
        check_planners([name for name in POLICIES if name != policy])


@pytest.mark.parametrize("search", sorted({planner.search for planner in PLANNERS.values()}))
def test_a_missing_search_is_named_with_its_planner(
    search: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    planner = next(planner for planner in PLANNERS.values() if planner.search == search)
    others = {name: known for name, known in SEARCHES.items() if name != search}
    monkeypatch.setattr(planners, "SEARCHES", others)
    with pytest.raises(InputError, match=f"planner {planner.name}, search: {search!r} is unknown"):
        check_planners(POLICIES)


def required_parts(name: str) -> list[tuple[str, ...]]:
    """The fields without which no robot file is complete."""
    document = yaml.safe_load((ROBOTS / f"{name}.yaml").read_text())
    (arm, *_) = document["arms"]
    own = [("arms", arm, field) for field in ("joints", "home", "tool", "hand_links")]
    return [("description",), ("base_link",), ("arms",), *own]


@pytest.mark.parametrize("name", robot_names())
def test_a_robot_file_without_one_of_its_parts_names_it(name: str, tmp_path: Path) -> None:
    for *folders, field in required_parts(name):
        document: dict[str, Any] = yaml.safe_load((ROBOTS / f"{name}.yaml").read_text())
        part = document
        for folder in folders:
            part = part[folder]
        del part[field]
        file = tmp_path / f"{field}.yaml"
        file.write_text(yaml.safe_dump(document))
        with pytest.raises(InputError, match=field):
            load_robot(str(file))
