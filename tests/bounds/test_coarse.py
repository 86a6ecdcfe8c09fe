"""The coarse bound: true verdicts, reasons, and what a verdict depends on."""

import numpy as np
import pytest

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.solver import Interpreter
from guided_lgp.bounds.results import CoarseResult
from guided_lgp.bounds.verify import verify_keyframes
from guided_lgp.logic import Skeleton, applicable_actions, parse_skeleton, progress, successor
from guided_lgp.poses import tilt
from guided_lgp.robots import load_robot
from guided_lgp.scene import Box, PlacedRobot, Scene, Table, generate
from guided_lgp.scene.setups import SETUPS
from guided_lgp.scene.world import World

SIZE = (0.15, 0.07, 0.10)
TABLES = (
    Table(name="tab1", position=(0.54, 0.33, 0.60), half_extents=(0.17, 0.20)),
    Table(name="tab2", position=(0.54, -0.33, 0.60), half_extents=(0.17, 0.20)),
)
PR2 = load_robot("pr2")
SCENE = Scene(
    tables=TABLES,
    boxes=(
        Box(name="red", size=SIZE, position=(0.47, 0.22, 0.65), yaw=0.3, on="tab1"),
        Box(name="green", size=SIZE, position=(0.55, 0.42, 0.65), yaw=-0.2, on="tab1"),
        Box(name="blue", size=SIZE, position=(0.50, -0.25, 0.65), on="tab2"),
    ),
)


@pytest.fixture(scope="module")
def bound() -> CoarseBound:
    return CoarseBound(SCENE, 9)


def _random_skeletons(scene: Scene, length: int, count: int, seed: int) -> list[Skeleton]:
    rng = np.random.default_rng(seed)
    skeletons = []
    for _ in range(count):
        state, skeleton = scene.state, []
        for _ in range(length):
            actions = list(applicable_actions(state, scene.symbols))
            skeleton.append(actions[rng.integers(len(actions))])
            state = successor(state, skeleton[-1])
        skeletons.append(tuple(skeleton))
    return skeletons


def _assert_true(scene: Scene, result: CoarseResult) -> None:
    """Check a feasible verdict in a world of its own."""
    assert result.feasible, str(result.failure)
    assert len(result.at_switch) == len(result.after_action) == len(result.skeleton)
    with World(scene) as world:
        fault = verify_keyframes(world, result.skeleton, result.at_switch, result.after_action)
    assert fault is None, str(fault)


@pytest.mark.parametrize(
    "text",
    [
        "(grasp pr2L red)",
        "(grasp pr2L green) (place pr2L green red)",
        "(grasp pr2L red) (place pr2L red green) (grasp pr2R blue) (place pr2R blue tab2)",
        # two boxes side by side on one
        "(grasp pr2L green) (place pr2L green red) (grasp pr2R blue) (place pr2R blue red)",
        # a tower of three
        "(grasp pr2L red) (place pr2L red green) (grasp pr2R blue) (place pr2R blue tab1) "
        "(grasp pr2L blue) (place pr2L blue red)",
        # a box with another on top is lifted, carried level and put down
        "(grasp pr2L green) (place pr2L green red) (grasp pr2L red) (place pr2L red tab1)",
        # a held box presented as a support, then emptied again
        "(grasp pr2L red) (grasp pr2R blue) (place pr2R blue red) (grasp pr2R blue)",
    ],
)
def test_feasible_sequences_are_found_and_true(bound: CoarseBound, text: str) -> None:
    _assert_true(SCENE, bound.solve(parse_skeleton(text)))


def test_random_verdicts_are_true_in_every_setup() -> None:
    feasible = 0
    for setup in SETUPS:
        scene = generate(setup, 1, 21, "x").scenes[0]
        bound = CoarseBound(scene, 9)
        for skeleton in _random_skeletons(scene, 5, 6, seed=5):
            result = bound.solve(skeleton)
            if result.feasible:
                feasible += 1
                _assert_true(scene, result)
            else:
                assert result.failure is not None
                assert 0 <= result.failure.action < 5
    assert feasible >= 6


def test_the_acting_arm_retreats_to_its_side(bound: CoarseBound) -> None:
    result = bound.solve(parse_skeleton("(grasp pr2L red) (place pr2L red tab1)"))
    for keyframe in result.after_action:
        assert np.array_equal(keyframe.q, PR2.home)
    assert result.after_action[0].boxes["red"][2] > 0.9  # at the hand, not on the table
    assert result.after_action[1].boxes["red"] == pytest.approx(result.at_switch[1].boxes["red"])


def test_an_arm_whose_box_carries_another_stays_level(bound: CoarseBound) -> None:
    lifted = bound.solve(
        parse_skeleton("(grasp pr2L green) (place pr2L green red) (grasp pr2L red)")
    )
    contact, lifted_away = lifted.at_switch[-1], lifted.after_action[-1]
    assert not np.allclose(lifted_away.q[:7], PR2.arms["pr2L"].home)
    for box in ("red", "green"):
        rise = lifted_away.boxes[box] - contact.boxes[box]
        assert rise == pytest.approx([0, 0, 0.08, 0, 0, 0, 0], abs=1e-9)

    text = "(grasp pr2L red) (grasp pr2R blue) (place pr2R blue red) (grasp pr2R blue)"
    presented = bound.solve(parse_skeleton(text))
    _, before, carrying, emptied = presented.after_action
    assert np.array_equal(before.q, PR2.home)
    assert np.array_equal(carrying.q[:7], presented.at_switch[2].q[:7])
    assert float(tilt(carrying.boxes["red"])) == pytest.approx(0, abs=1e-6)
    assert np.array_equal(emptied.q, PR2.home)


def test_a_failure_names_constraint_and_action() -> None:
    shelf = Table(name="shelf", position=(0.54, 0.0, 0.6), half_extents=(0.05, 0.05))
    full = Box(name="full", size=SIZE, position=(0.54, 0.0, 0.65), on="shelf")
    scene = Scene(tables=(TABLES[0], shelf), boxes=(SCENE.boxes[0], full))
    result = CoarseBound(scene, 9).solve(parse_skeleton("(grasp pr2L red) (place pr2L red shelf)"))
    assert not result.feasible
    assert result.failure is not None
    assert result.failure.action == 1
    assert result.failure.constraint in ("beside red full", "balanced red shelf")
    assert 0.001 < result.failure.violation < 0.1
    assert "9 starts" in str(result.failure)


def test_what_an_arm_cannot_reach_is_said_without_a_start(bound: CoarseBound) -> None:
    result = bound.solve(
        parse_skeleton("(grasp pr2L red) (place pr2L red tab1) (grasp pr2R green)")
    )
    assert result.failure is not None
    assert (result.failure.action, result.failure.constraint) == (2, "hold pr2R green")
    assert result.restarts == 0


def test_a_box_wider_than_the_fingers_open_is_not_grasped() -> None:
    wide = Box(name="wide", size=(0.15, 0.12, 0.1), position=(0.5, 0.3, 0.65), on="tab1")
    result = CoarseBound(Scene(tables=TABLES, boxes=(wide,)), 9).solve(
        parse_skeleton("(grasp pr2L wide)")
    )
    assert result.failure is not None
    assert result.failure.constraint == "width of wide"
    assert result.failure.violation == pytest.approx(0.035)


def test_boxes_of_other_sizes_are_grasped_across_their_narrow_side() -> None:
    boxes = (
        Box(name="cube", size=(0.06, 0.06, 0.06), position=(0.5, 0.25, 0.63), on="tab1"),
        Box(name="plank", size=(0.05, 0.2, 0.08), position=(0.5, 0.42, 0.64), yaw=1.2, on="tab1"),
    )
    scene = Scene(tables=TABLES, boxes=boxes)
    text = "(grasp pr2L cube) (place pr2L cube plank) (grasp pr2L cube)"
    _assert_true(scene, CoarseBound(scene, 9).solve(parse_skeleton(text)))


def test_an_extension_of_an_infeasible_prefix_is_infeasible(bound: CoarseBound) -> None:
    prefix = bound.solve(parse_skeleton("(grasp pr2R green)"))
    skeleton = parse_skeleton("(grasp pr2R green) (grasp pr2L red)")
    for result in (bound.solve(skeleton, prefix), bound.solve(skeleton)):
        assert not result.feasible
        assert result.failure == prefix.failure


def test_a_prefix_of_another_skeleton_is_refused(bound: CoarseBound) -> None:
    other = bound.solve(parse_skeleton("(grasp pr2L red)"))
    with pytest.raises(ValueError, match="another skeleton"):
        bound.solve(parse_skeleton("(grasp pr2L green) (place pr2L green red)"), other)


def test_a_verdict_depends_on_scene_and_skeleton_only(bound: CoarseBound) -> None:
    for skeleton in _random_skeletons(SCENE, 4, 6, seed=8):
        fresh = CoarseBound(SCENE, 9).solve(skeleton)
        prefix = bound.solve(skeleton[:-1])
        for again in (bound.solve(skeleton, prefix), bound.solve(skeleton)):
            assert again.feasible == fresh.feasible
            assert again.restarts == fresh.restarts or not fresh.feasible
            for one, other in zip(again.at_switch, fresh.at_switch, strict=True):
                assert np.array_equal(one.q, other.q)


def test_verdicts_do_not_depend_on_where_the_robot_stands(bound: CoarseBound) -> None:
    def moved(x: float, y: float) -> tuple[float, float]:
        return 1.0 - y, 2.0 + x  # by a quarter turn about the origin, then (1, 2)

    turn = np.pi / 2
    scene = Scene(
        robot=PlacedRobot(base=(1.0, 2.0, turn)),
        tables=tuple(
            t.model_copy(update={"position": (*moved(*t.position[:2]), t.position[2]), "yaw": turn})
            for t in SCENE.tables
        ),
        boxes=tuple(
            b.model_copy(update={"position": (*moved(*b.position[:2]), 0.65), "yaw": b.yaw + turn})
            for b in SCENE.boxes
        ),
    )
    elsewhere = CoarseBound(scene, 9)
    for skeleton in _random_skeletons(SCENE, 3, 5, seed=2):
        result = elsewhere.solve(skeleton)
        assert result.feasible == bound.solve(skeleton).feasible
        if result.feasible:
            _assert_true(scene, result)


def test_further_solutions_are_distinct_and_true(bound: CoarseBound) -> None:
    skeleton = parse_skeleton("(grasp pr2L red) (place pr2L red tab1)")
    results = list(bound.solutions(skeleton, 4))
    assert len(results) == 4
    for result in results:
        _assert_true(SCENE, result)
    poses = {tuple(np.round(r.at_switch[1].boxes["red"], 4)) for r in results}
    assert len(poses) == 4
    again = list(bound.solutions(skeleton, 4))
    assert all(
        np.array_equal(one.at_switch[1].q, other.at_switch[1].q)
        for one, other in zip(results, again, strict=True)
    )


def test_the_interpreter_gives_the_same_verdicts(bound: CoarseBound) -> None:
    slow = CoarseBound(SCENE, 9, Interpreter(load_robot("pr2")))
    verdicts = []
    for skeleton in _random_skeletons(SCENE, 3, 4, seed=3):
        prefixes = [bound.solve(skeleton[:k]) for k in (1, 2, 3)]
        if not all(prefix.feasible for prefix in prefixes[:2]):
            continue
        result = slow.solve(skeleton, prefixes[1])
        assert result.feasible == prefixes[2].feasible
        verdicts.append(result.feasible)
    assert True in verdicts


def test_carried_boxes_move_along(bound: CoarseBound) -> None:
    text = "(grasp pr2L green) (place pr2L green red) (grasp pr2L red) (place pr2L red tab1)"
    result = bound.solve(parse_skeleton(text))
    assert progress(SCENE.state, result.skeleton).support_of("green") == "red"
    final = result.after_action[-1].boxes
    assert final["green"][2] - final["red"][2] == pytest.approx(0.10, abs=1e-6)
    before = result.after_action[1].boxes
    distances = [np.linalg.norm(boxes["green"][:2] - boxes["red"][:2]) for boxes in (before, final)]
    assert distances[0] == pytest.approx(distances[1], abs=1e-3)


def test_what_is_put_on_top_balances_a_tower_of_ten() -> None:
    """Eight boxes are 10 mm inside the edge of the lowest; the tenth goes to the other side."""
    low = (0.15, 0.07, 0.05)
    tower = [
        Box(
            name=f"b{level}",
            size=low,
            position=(0.50, 0.25 - 0.025 * (level > 0), 0.625 + 0.05 * level),
            on=f"b{level - 1}" if level else "tab1",
        )
        for level in range(9)
    ]
    beside = Box(name="b9", size=low, position=(0.50, 0.45, 0.625), on="tab1")
    high = Scene(tables=TABLES, boxes=(*tower, beside))
    result = CoarseBound(high, 9).solve(parse_skeleton("(grasp pr2L b9) (place pr2L b9 b8)"))
    _assert_true(high, result)
    boxes = result.after_action[-1].boxes
    middle = np.mean([boxes[f"b{level}"][1] for level in range(1, 10)])
    assert middle - (0.25 - 0.035) > 0.0115


@pytest.mark.parametrize("hands", [("pr2L", "pr2R"), ("pr2R", "pr2L")])
def test_a_box_is_handed_over_and_put_down(hands: tuple[str, str]) -> None:
    scene = SCENE.model_copy(update={"domain": "handover"})
    giver, taker = hands
    box, table = ("red", "tab2") if giver == "pr2L" else ("blue", "tab1")
    text = f"(grasp {giver} {box}) (take {taker} {giver} {box}) (place {taker} {box} {table})"
    result = CoarseBound(scene, 9).solve(parse_skeleton(text))
    _assert_true(scene, result)
    both = result.at_switch[1].q.reshape(2, 7)
    home = result.after_action[1].q.reshape(2, 7)
    assert np.all(np.abs(both - home).max(axis=1) > 0.1)  # both arms are at the box
    at_hand, in_between = (
        frame.boxes[box] for frame in (result.after_action[1], result.at_switch[1])
    )
    assert float(tilt(in_between)) == pytest.approx(0.0, abs=1e-6)
    assert np.linalg.norm(at_hand[:3] - in_between[:3]) > 0.1
