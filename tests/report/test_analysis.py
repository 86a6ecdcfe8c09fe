import pandas as pd
import pytest

from guided_lgp.domains import load_domain
from guided_lgp.logic import Goal
from guided_lgp.report import analysis
from guided_lgp.scene import Box, Scene, Table

SCENE = Scene(
    name="s",
    tables=(
        Table(name="tab1", position=(0.54, 0.33, 0.6), half_extents=(0.17, 0.2)),
        Table(name="tab2", position=(0.54, -0.33, 0.6), half_extents=(0.17, 0.2)),
    ),
    boxes=(
        Box(name="red", size=(0.15, 0.07, 0.1), position=(0.5, 0.3, 0.65), on="tab1"),
        Box(name="green", size=(0.15, 0.07, 0.1), position=(0.5, 0.45, 0.65), on="tab1"),
    ),
)


@pytest.mark.parametrize(
    ("constraint", "kind"),
    [
        ("clear l_forearm_link tab2", "clear robot–table"),
        ("clear r_gripper_palm_link red", "clear box–robot"),
        ("balanced red tab1", "balanced box–table"),
        ("hold pr2L red", "hold"),
        ("width of red", "width"),
        ("joint limit l_elbow_flex_joint", "joint limit"),
        ("no motion found", "no motion found"),
    ],
)
def test_constraint_kinds_have_no_names(constraint: str, kind: str) -> None:
    assert analysis.constraint_kind(constraint, SCENE) == kind


def test_objective_kinds() -> None:
    boxes = ("red", "green", "blue")
    assert analysis.objective_kind("(held red)", boxes) == "held"
    assert analysis.objective_kind("(on red tab1) (on green blue)", boxes) == "on box + on table"


def test_last_actions_by_arm_and_table() -> None:
    skeletons = {
        "(grasp pr2L red)": True,
        "(grasp pr2R red)": False,
        "(grasp pr2L red) (place pr2L red tab2)": True,
        "(grasp pr2L red) (place pr2L red green)": False,
        "(grasp pr2L red) (grasp pr2R green)": True,
        "(grasp pr2L red) (grasp pr2R green) (place pr2R green red)": False,
    }
    verdicts = pd.DataFrame(
        [{"configuration": "s", "skeleton": s, "feasible": f} for s, f in skeletons.items()]
    )
    shares = analysis.by_last_action(verdicts, {"s": SCENE})
    found = {
        (row.instruction, row.gripper, row.table): (row.n, row.feasible)
        for row in shares.itertuples()
    }
    assert found == {
        ("grasp", "pr2L", "tab1"): (1, 1),
        ("grasp", "pr2R", "tab1"): (2, 1),
        ("place", "pr2L", "box"): (1, 0),
        ("place", "pr2L", "tab2"): (1, 1),
        ("place", "pr2R", "held box"): (1, 0),
    }


def test_failures_are_counted_by_constraint_and_action() -> None:
    rows = [("hold pr2L red", 0), ("hold pr2R red", 2), ("beside red green", 2)]
    verdicts = pd.DataFrame(
        [
            {
                "configuration": "s",
                "feasible": False,
                "failure_constraint": constraint,
                "failure_action": action,
            }
            for constraint, action in rows
        ]
    )
    counts = analysis.failures(verdicts, {"s": SCENE})
    assert list(counts.index) == ["hold", "beside box–box"]
    assert counts.loc["hold"].to_dict() == {1: 1, 3: 1}


def test_without_failures_the_table_is_empty() -> None:
    columns = ["configuration", "failure_constraint", "failure_action"]
    verdicts = pd.DataFrame([("s", None, None)], columns=columns).assign(feasible=True)
    assert analysis.failures(verdicts, {"s": SCENE}).empty


def test_novelty_is_up_to_the_names_of_the_boxes() -> None:
    symbols = load_domain().symbols(gripper=("pr2L",), box=("red", "green"), table=("tab1", "tab2"))
    kinds = analysis.novelty(symbols, [(Goal("held", ("red",)), Goal("on", ("green", "tab1")))])
    assert kinds["(held red) (on green tab1)"] == "seen"
    assert kinds["(held green) (on red tab1)"] == "renamed"
    assert kinds["(held red) (on green tab2)"] == "new"
    assert kinds["(held red)"] == "new"


def test_shares_by_novelty_leave_out_what_holds_at_the_start() -> None:
    rows = [("(held red)", "shortest"), ("(held red)", "trivial"), ("(held green)", "feasible")]
    problems = pd.DataFrame(rows, columns=["objective", "outcome"]).assign(planner="default")
    shares = analysis.by_novelty(problems, {"(held red)": "seen", "(held green)": "new"})
    assert shares.to_dict("records") == [
        {"planner": "default", "kind": "new", "n": 1, "shortest": 0.0},
        {"planner": "default", "kind": "seen", "n": 1, "shortest": 1.0},
    ]


def test_calls_count_solved_problems_only() -> None:
    counts = {
        "policy_calls": [6, 90, 2],
        "coarse_calls": [5, 90, 2],
        "infeasible_calls": [1, 80, 0],
        "failed_candidates": [1, 9, 0],
    }
    problems = pd.DataFrame({"planner": "default", "length": [4, None, 2], **counts})
    assert analysis.calls(problems) == {
        "default": {
            "policy_calls": 1.25,
            "coarse_calls": 3.5,
            "infeasible_calls": 0.5,
            "failed_candidates": 0.5,
        }
    }
