"""Which goals need further instructions, by what arms can do with a body alone in the scene."""

from pathlib import Path

import pytest

from guided_lgp.bounds.deadline import Deadline, OutOfTimeError
from guided_lgp.domains import extensions
from guided_lgp.logic import parse_objective
from guided_lgp.params import load_planning
from guided_lgp.scene import load_scene
from guided_lgp.search.ways import has_way, widened_scene

ROOT = Path(__file__).parents[2]
PARAMS = load_planning().bounds
FAR = load_scene(ROOT / "tests/cases/handover_only.json")
NEAR = load_scene(ROOT / "examples/three_boxes.json")


def test_a_domain_says_what_it_extends() -> None:
    assert extensions("pick_and_place") == ("handover",)
    assert extensions("handover") == ()


def test_only_what_needs_it_is_widened() -> None:
    wider = widened_scene(FAR, parse_objective(["(on parcel farright)"]), PARAMS)
    assert wider is not None
    assert wider.domain == "handover"
    assert widened_scene(NEAR, parse_objective(["(on red tab2)", "(held blue)"]), PARAMS) is None
    # on other bodies and where it is: nothing to say
    assert widened_scene(NEAR, parse_objective(["(on red green)", "(on red tab1)"]), PARAMS) is None


def test_a_way_goes_over_furniture_and_grippers() -> None:
    assert has_way(FAR, "parcel", frozenset({"pr2L"}), PARAMS)
    assert not has_way(FAR, "parcel", frozenset({"pr2R"}), PARAMS)


def test_the_limit_of_time_holds() -> None:
    with pytest.raises(OutOfTimeError):
        has_way(FAR, "parcel", frozenset({"pr2R"}), PARAMS, Deadline.after(0))
