"""Of several motions the one whose grips hold is taken."""

from collections.abc import Iterator
from functools import cache

import pytest

from guided_lgp.bounds.deadline import OutOfTimeError
from guided_lgp.bounds.execution.forces import RATIO, grips_of
from guided_lgp.bounds.path.firm import firmest
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import load_planning
from guided_lgp.scene.generate import generate

(SCENE,) = generate("a", 1, 30_003, "execution-003").scenes
LOADED = parse_skeleton(
    "(grasp pr2R green) (place pr2R green red) (grasp pr2R red) (grasp pr2L green)"
)
"""The coarse solution has red held so far from its middle that green turns it in the hand."""


@cache
def motion(firm: bool) -> PathResult:
    return SceneBounds(SCENE, load_planning().bounds, firm=firm).path(LOADED)


def load(found: PathResult) -> float:
    assert found.trajectory is not None
    rows = switches_of(SCENE, LOADED, found.trajectory)
    assert isinstance(rows, list)
    return max(grip.ratio for grip in grips_of(SCENE, LOADED, rows, found.trajectory))


def test_a_stack_is_held_where_the_pads_can_carry_it() -> None:
    assert load(motion(firm=False)) > 0.6
    assert load(motion(firm=True)) == pytest.approx(RATIO, abs=1e-6)


def test_what_holds_best_is_taken_where_nothing_holds() -> None:
    assert firmest(SCENE, iter([motion(firm=False)])) is motion(firm=False)
    assert firmest(SCENE, iter([])) is None


@pytest.mark.parametrize("found", [True, False])
def test_when_time_is_over_what_has_been_found_is_taken(found: bool) -> None:
    def motions() -> Iterator[PathResult]:
        if found:
            yield motion(firm=False)
        raise OutOfTimeError

    if found:
        assert firmest(SCENE, motions()) is motion(firm=False)
    else:
        with pytest.raises(OutOfTimeError):
            firmest(SCENE, motions())
