"""What ``make verify-execution`` counts, and the page of its figures."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from guided_lgp.bounds.execution import Conditions
from guided_lgp.logic import Skeleton, parse_skeleton
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import duration
import execution


def test_a_hand_is_loaded_that_carries_a_box_on_the_one_it_holds() -> None:
    (scene,) = generate("a", 1, 1, "test").scenes
    alone = parse_skeleton("(grasp pr2L red) (place pr2L red green)")
    assert execution.single(scene, alone)
    assert execution.loaded(scene, (*alone, *parse_skeleton("(grasp pr2R green)")))


def test_a_random_plan_keeps_all_limits_and_is_carried_out() -> None:
    row = execution.shipped(execution.Task(3))
    assert row is not None
    assert row["succeeded"], row["fault"]
    assert row["drift_mm"] < 2
    assert not any(row["rows_outside_limits"].values())
    assert row["clearance_mm"] >= 1


@pytest.mark.parametrize(
    ("number", "wanted", "friction"), [(2, execution.loaded, 0.6), (19, execution.single, 1.0)]
)
def test_friction_holds_boxes_and_lets_go_of_them(
    number: int, wanted: Callable[[Scene, Skeleton], bool], friction: float
) -> None:
    """At 480 steps per second, loaded ones have crept by up to 13 mm; with a friction of 1.0,
    finger hulls that reached into a box as they left have thrown it away.
    """
    task = execution.Task(number, wanted=wanted, conditions=(Conditions("friction", friction),))
    (row,) = execution.carried_out(task)
    assert row["succeeded"], row["fault"]
    assert row["drift_mm"] < 3


def test_a_tower_of_eight_is_built_as_planned() -> None:
    row = execution.built("e8", 0)
    assert row["succeeded"], row["fault"]
    assert row["drift_mm"] < 5


def test_plans_that_were_not_found_do_not_count() -> None:
    rows = [{"succeeded": True, "fault": ""}, None, {"succeeded": False, "fault": "drift red"}]
    assert execution.counted(rows) == {"plans": 2, "succeeded": 1, "faults": ["drift red"]}


def test_the_page_has_a_row_for_each_part_with_its_faults() -> None:
    cell = {"plans": 40, "succeeded": 38, "faults": ["drift red", ""], "survived": 30}
    figures = {
        **cell,
        "rows_outside_limits": 0,
        "duration_ratio": {hands: {"median": 0.5, "worst": 0.7} for hands in duration.HANDS},
        "waiting_share": 0.2,
        "smallest_clearance_mm": 2.5,
        "friction": {"0.6": cell},
        "towers": {"8": cell},
        "closed_loop_8mm": cell | {"open_loop": cell},
        **dict.fromkeys(("friction_loaded", "friction_noise_5mm", "disturbed"), cell),
    }
    assert figures.keys() >= execution.PARTS
    page = execution.page(figures)
    assert "| friction alone, μ = 0.6 | 38 | 40 | 1 `drift`, 1 `goal` |" in page
    assert "| towers of 8 | 38 | 40 |" in page
    assert "| the same plans in open loop | 38 | 40 |" in page
    assert "not touched: 2.5 mm" in page
