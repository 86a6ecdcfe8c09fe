"""Facts of pairs: found with two boxes alone, true with all of them."""

import pytest

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.pairs import Pairs
from guided_lgp.bounds.coarse.parts import projected, stacked_with
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Action, applicable_actions, parse_skeleton
from guided_lgp.params import BoundsParams
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.scene.families import draw_problems, find_family
from guided_lgp.scene.families.rows import Rows

PARAMS = BoundsParams(coarse_restarts=12, path_solutions=1)
TABLES = (
    Table(name="tab1", position=(0.54, 0.33, 0.6), half_extents=(0.17, 0.25)),
    Table(name="tab2", position=(0.54, -0.33, 0.6), half_extents=(0.17, 0.25)),
)


def box(name: str, y: float, height: float) -> Box:
    return Box(
        name=name, size=(0.12, 0.06, height), position=(0.52, y, 0.6 + height / 2), on="tab1"
    )


SCENE = Scene(
    tables=TABLES, boxes=(box("low", 0.2, 0.05), box("tall", 0.275, 0.14), box("far", 0.5, 0.14))
)
"""The tall box stands 1.5 cm beside the low one."""


@pytest.fixture(scope="module")
def bounds() -> SceneBounds:
    return SceneBounds(SCENE, PARAMS)


@pytest.fixture(scope="module")
def pairs(bounds: SceneBounds) -> Pairs:
    return Pairs(SCENE, bounds.coarse, bounds.part)


@pytest.mark.parametrize(
    ("action", "blockers"),
    [
        ("(grasp pr2L low)", [{"tall"}]),
        ("(grasp pr2R low)", [{"tall"}]),
        ("(grasp pr2L tall)", []),
        ("(grasp pr2L far)", []),
        ("(grasp pr2R far)", [set()]),  # out of reach, whatever stands beside it
    ],
)
def test_who_blocks_whom(pairs: Pairs, action: str, blockers: list[set[str]]) -> None:
    assert list(map(set, pairs.blockers(Action.parse(action)))) == blockers


def test_a_fact_holds_until_the_neighbour_has_moved(bounds: SceneBounds) -> None:
    blocked = bounds.coarse(parse_skeleton("(grasp pr2L far) (grasp pr2R low)"))
    assert (blocked.feasible, blocked.restarts) == (False, 0)
    assert str(blocked.failure) == (
        "action 2: grasp pr2R low tall violated (infeasible in the scene of these boxes alone)"
    )
    assert bounds.coarse(parse_skeleton("(grasp pr2L tall) (grasp pr2R low)")).feasible


def test_the_whole_scene_allows_nothing_that_a_pair_denies() -> None:
    """In rows, over every action at the start and every one after it."""
    for drawn in draw_problems(find_family("rows"), Rows(), 4, 2, 7, "pairs"):
        scene = drawn.scene
        known, solver = SceneBounds(scene, PARAMS), CoarseBound(scene, 12)
        pairs = Pairs(scene, known.coarse, known.part)
        denied = 0
        for action in applicable_actions(scene.state, scene.symbols):
            for boxes in pairs.blockers(action):
                denied += 1
                assert not solver.solve((action,)).feasible
                away = [
                    box.name for box in scene.boxes if box.name not in (*boxes, *action.symbols)
                ]
                other = "pr2L" if action.symbols[0] == "pr2R" else "pr2R"
                first = [Action("grasp", (other, name)) for name in away]
                assert not any(solver.solve((one, action)).feasible for one in first)
        assert denied > 0


def test_parts_of_a_sequence() -> None:
    skeleton = parse_skeleton("(grasp pr2L tall) (place pr2L tall far) (grasp pr2R low)")
    assert projected(skeleton, SCENE, frozenset({"low"})) == skeleton[2:]
    assert stacked_with(skeleton, SCENE, "tall") == {"tall", "far"}
    assert stacked_with(skeleton[:1], SCENE, "tall") == {"tall"}
