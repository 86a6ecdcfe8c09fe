"""What ``make verify-execution`` counts, and the page of its figures."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

from guided_lgp.bounds.execution import Conditions
from guided_lgp.logic import Skeleton, parse_skeleton
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import duration
import execution
import version
from against import Pair


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


class Scripted:
    """Both versions, of which the older one finds nothing in setup c."""

    def __init__(self) -> None:
        self.new = self
        self.setups: list[str] = []

    def ask(self, request: str, setup: str, number: int, *rest: Any) -> Any:
        if request == "open_goals":
            return version.open_goals(setup, number)
        self.setups.append(setup)
        assert rest[1] == 8
        return {
            "old": {"feasible": setup != "c", "duration_s": 10.0},
            "new": {"feasible": True, "duration_s": 4.0},
        }


def test_the_best_plans_of_every_setup_are_compared_where_both_find_one() -> None:
    pair = Scripted()
    assert list(duration.best_ratios(cast("Pair", pair), 7)) == 6 * [0.4]
    assert pair.setups == list(duration.SETUPS)


def test_the_best_of_eight_plans_is_faster_though_one_hand_alone_reaches_all() -> None:
    one, best = (
        version.best_plan("d", 9, ["(on green blue)", "(on blue red)"], candidates)["duration_s"]
        for candidates in (1, 8)
    )
    assert best < 0.85 * one


def test_the_page_has_a_row_for_each_part_with_its_faults() -> None:
    cell = {"plans": 40, "succeeded": 38, "faults": ["drift red", ""], "survived": 30}
    figures = {
        **cell,
        "rows_outside_limits": 0,
        "duration_ratio": {
            row: {"median": 0.5, "worst": 0.7} for row in (*duration.HANDS, "candidates_8")
        },
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
    assert "takes 0.50 in the median and 0.70 at most" in page
