"""Every declared instruction, goal type, robot, planner and policy, walked through every layer.

The first half shows that each layer has a part for each declaration; the second takes parts away,
and asks for a message that names what is missing.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from guided_lgp.bounds import vocabulary
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.path import check_motions, steps
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.terms import kernel_table, term_names
from guided_lgp.bounds.vocabulary import check_terms
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
    check_policies,
    load_policy,
    missing_instructions,
)
from guided_lgp.robots import load_robot, robot_names
from guided_lgp.robots.build import read_robot
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
    monkeypatch.setattr(vocabulary, "term_names", lambda: others)
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


def without_a_part(one: Any) -> Iterator[tuple[str, Any]]:
    """A declaration without each of its parts: the field and the name of the part, and the rest."""
    for field in fields(one):
        parts = getattr(one, field.name)
        if isinstance(parts, tuple):
            for number, part in enumerate(parts):
                name = getattr(part, "predicate", getattr(part, "name", "attach"))
                others = parts[:number] + parts[number + 1 :]
                yield f"{field.name} {name}", replace(one, **{field.name: others})
        elif parts:
            nothing = "" if isinstance(parts, str) else None
            yield field.name, replace(one, **{field.name: nothing})


def without_an_option(one: Any) -> Iterator[tuple[str, Any]]:
    """An instruction without each of the options of its terms and steps."""
    for field in ("contact", "motion"):
        terms = getattr(one, field)
        for number, term in enumerate(terms):
            for option in term.options:
                others = {name: value for name, value in term.options.items() if name != option}
                less = (*terms[:number], replace(term, options=others), *terms[number + 1 :])
                yield f"{field} {term.name} {option}", replace(one, **{field: less})


def refused(domain: Domain, one: Any, less: Any) -> str:
    """The line with which a domain is refused that has another declaration in place of one."""
    lists = ("instructions", "goal_types", "further_goals")
    changed = {
        name: tuple(less if known == one else known for known in getattr(domain, name))
        for name in lists
    }
    try:
        other = replace(domain, extends=None, **changed)
        check_terms(other)
        check_motions(other)
    except InputError as error:
        return str(error)
    return ""


OPTIONAL = {
    "precondition same": "that one hand is free and another holds the box says it, too",
    "precondition clear": "a rule of the domain: no stacks are handed over",
    "contact present by": "for readers: the state says who holds the body",
    "motion present by": "for readers",
    "motion line_out otherwise": "further ways, where the first is not free",
    "motion home": "an arm without it stays where it is",
    "derived": "what a text may leave out",
}
"""Without what a declaration is still one, and why."""


@pytest.mark.parametrize(
    ("domain", "kind", "name"),
    [
        *((domain, "instruction", name) for domain, name in INSTRUCTIONS),
        *((domain, "goal type", name) for domain, name in [*GOAL_TYPES, *FURTHER_GOALS]),
    ],
)
def test_a_declaration_without_one_of_its_parts_is_named(domain: str, kind: str, name: str) -> None:
    declared = load_domain(domain)
    lists = {
        "instruction": declared.instructions,
        "goal type": (*declared.goal_types, *declared.further_goals),
    }
    one = next(one for one in lists[kind] if one.name == name)
    options = without_an_option(one) if kind == "instruction" else ()
    for part, less in (*without_a_part(one), *options):
        line = refused(declared, one, less)
        if part in OPTIONAL:
            assert not line, f"{name}, {part}: not optional"
        elif part == "name":
            assert "'' is not a name" in line
        else:
            assert line.startswith(f"{domain}.py: {kind} {name}, "), f"{name}, {part}: {line}"
            assert any(word in line for word in part.split()), f"{name}, {part}: {line}"
            assert len(line.splitlines()) == 1


@pytest.mark.parametrize("policy", POLICIES)
def test_a_missing_policy_is_named_with_its_planner(policy: str) -> None:
    planner = next(planner for planner in PLANNERS.values() if planner.policy == policy)
    with pytest.raises(InputError, match=f"planner {planner.name}, policy: {policy!r} is unknown"):
        check_planners([name for name in POLICIES if name != policy])


def without_a_field(one: Any) -> Iterator[tuple[str, Any]]:
    """A row without each of the fields that it states: with what counts if it does not."""
    for field in fields(one):
        stated = getattr(one, field.name)
        default = "" if field.default is MISSING else field.default
        if stated != default and not callable(stated):
            yield field.name, replace(one, **{field.name: default})


CHOICES = {
    **dict.fromkeys(("adapt", "over_sequences", "widens"), "how it searches: two ways"),
    **dict.fromkeys(("table_1", "table_3", "drawn", "headline", "printed"), "what has a row of it"),
    **dict.fromkeys(("marker", "linestyle"), "looks, the same for several"),
    "color": "the one of its policy",
}
"""Fields without which a planner or search is another one, but whole, and why."""


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_without_one_of_its_parts_is_named(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for field, less in without_a_field(PLANNERS[name]):
        monkeypatch.setattr(planners, "PLANNERS", {name: less})
        if field in CHOICES and not (field == "color" and not less.policy):
            check_planners(POLICIES)
            continue
        named = "" if field == "name" else name
        with pytest.raises(InputError, match=rf"^planners\.py: planner {named}, {field}: "):
            check_planners(POLICIES)


@pytest.mark.parametrize("name", SEARCHES)
def test_a_search_without_one_of_its_parts_is_named(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    planner = next((one.name for one in PLANNERS.values() if one.search == name), None)
    for field, less in without_a_field(SEARCHES[name]):
        monkeypatch.setattr(planners, "SEARCHES", {**SEARCHES, name: less})
        if field in CHOICES or (field == "follows_policy" and planner is None):
            continue
        where = f"planner {planner}, policy" if field == "follows_policy" else f"search {name}"
        with pytest.raises(InputError, match=rf"^planners\.py: {where}"):
            check_planners(POLICIES)


@pytest.mark.parametrize("which", ["printed", "headline"])
def test_the_planner_that_tables_speak_of_is_one(
    which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planners, "TABLE_3", {})
    with pytest.raises(InputError, match=rf"planners\.py: PLANNERS: none is {which}"):
        planners.the_one(which, lambda planner: getattr(planner, which))


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_without_one_of_its_parts_is_named(name: str) -> None:
    check_policies(list(POLICIES.values()))
    for field, less in without_a_field(POLICIES[name]):
        every = [less if one.name == name else one for one in POLICIES.values()]
        with pytest.raises(InputError, match=rf"^polic.*, {field}: ") as error:
            check_policies(every)
        assert less.name in str(error.value) or field == "default"


@pytest.mark.parametrize("search", sorted({planner.search for planner in PLANNERS.values()}))
def test_a_missing_search_is_named_with_its_planner(
    search: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    planner = next(planner for planner in PLANNERS.values() if planner.search == search)
    others = {name: known for name, known in SEARCHES.items() if name != search}
    monkeypatch.setattr(planners, "SEARCHES", others)
    with pytest.raises(InputError, match=f"planner {planner.name}, search: {search!r} is unknown"):
        check_planners(POLICIES)


def parts_of(document: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The keys and list entries of a robot file, but for the numbers of what is derived."""
    if isinstance(document, dict | list):
        for key in document if isinstance(document, dict) else range(len(document)):
            yield (*way, key)
            if key not in DERIVED:
                yield from parts_of(document[key], (*way, key))


DERIVED = {
    *("palm_front", "hand_radius", "segments", "lever_arms", "metric", "spheres", "signs"),
    *("spheres_between_arms", "gap", "lever", "grasp_width", "srdf"),
}
"""Fields of robot files that follow from the description where they are not stated."""
DEFAULTS = {
    **dict.fromkeys(("packages", "example-robot-data"), "found above the URDF as well"),
    "acceleration": "2 per s, and a line says so",
    "balanced": "no springs",
    "force": "40 N",
    "pad": "10 mm",
    "offset": "none: the frame is the link's",
    "left": "a robot with fewer arms",
    "right": "a robot with fewer arms",
    "pr2R": "a robot with fewer arms",
    "ee_link": "a flange, as well a part of the arm",
    "left_hand_link": "a flange",
    "right_hand_link": "a flange",
}
"""What else a robot file may be without, and why."""


@pytest.mark.parametrize("name", robot_names())
def test_a_robot_file_without_one_of_its_parts_names_it(name: str, tmp_path: Path) -> None:
    text = (ROBOTS / f"{name}.yaml").read_text().replace("../", f"{ROBOTS.parent}/")
    for *folders, last in parts_of(yaml.safe_load(text)):
        document: Any = yaml.safe_load(text)
        part = document
        for folder in folders:
            part = part[folder]
        key = last if isinstance(last, str) else part[last]
        del part[last]
        file = tmp_path / f"{name}.yaml"
        file.write_text(yaml.safe_dump(document, sort_keys=False))
        if key in DERIVED or key in DEFAULTS:
            read_robot(file)
            continue
        named = [word for word in (last, *folders) if isinstance(word, str)][:2]
        with pytest.raises(InputError, match=rf"{name}\.yaml: .*({'|'.join(named)})") as error:
            read_robot(file)
        assert len(str(error.value).splitlines()) == 1
