"""What ``make verify-execution`` counts, and the page of its figures."""

import sys
from pathlib import Path

from guided_lgp.logic import parse_skeleton
from guided_lgp.scene.generate import generate

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
import execution


def test_a_hand_is_loaded_that_carries_a_box_on_the_one_it_holds() -> None:
    (scene,) = generate("a", 1, 1, "test").scenes
    alone = parse_skeleton("(grasp pr2L red) (place pr2L red green)")
    assert execution.single(scene, alone)
    assert execution.loaded(scene, (*alone, *parse_skeleton("(grasp pr2R green)")))


def test_plans_that_were_not_found_do_not_count() -> None:
    rows = [{"succeeded": True, "fault": ""}, None, {"succeeded": False, "fault": "drift red"}]
    assert execution.counted(rows) == {"plans": 2, "succeeded": 1, "faults": ["drift red"]}


def test_the_page_has_a_row_for_each_part() -> None:
    cell = {"plans": 40, "succeeded": 39, "faults": ["drift red"]}
    figures = {
        **cell,
        "rows_outside_limits": 0,
        "waiting_share": 0.2,
        "smallest_clearance_mm": 2.5,
        "friction": {"0.6": cell},
        "towers": {"8": cell},
        "disturbed": cell,
    }
    page = execution.page(figures)
    assert "| friction alone, μ = 0.6 | 39 | 40 |" in page
    assert "| towers of 8 | 39 | 40 |" in page
    assert "Smallest distance from what is not touched: 2.5 mm" in page
