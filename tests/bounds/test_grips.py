"""Ways to hold a box: verification accepts all that are tried; hands open as far as asked."""

from functools import cache, partial

import numpy as np
import pytest

from guided_lgp.bounds.coarse.variants import Variant, Variants
from guided_lgp.bounds.path.grips import Grips, grips_of
from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.verify.geometry import grasp_faults
from guided_lgp.logic import parse_skeleton
from guided_lgp.poses import compose, pose, quaternion
from guided_lgp.robots import load_robot
from guided_lgp.robots.robot import CLEARANCE
from guided_lgp.scene import Box, Scene, Table

ARM = load_robot("pr2").arms["pr2L"]
TABLE = Table(name="tab", position=(0.54, 0.3, 0.6), half_extents=(0.2, 0.2))


def box(*size: float) -> Box:
    x, y, z = size
    return Box(name="red", size=(x, y, z), position=(0.5, 0.3, 0.6 + z / 2), on="tab")


def every(grips: dict[float, tuple[Grips, Grips]]) -> list[tuple[float, Grips]]:
    return [(width, part) for width, parts in grips.items() for part in parts]


@pytest.mark.parametrize(
    ("size", "widths"),
    [
        ((0.15, 0.07, 0.10), [0.07]),
        ((0.07, 0.15, 0.10), [0.07]),
        ((0.05, 0.04, 0.07), [0.04, 0.05]),
        ((0.06, 0.06, 0.06), [0.06]),
        ((0.12, 0.12, 0.10), []),
    ],
)
def test_a_box_is_held_on_every_pair_of_sides_that_the_hand_takes(
    size: tuple[float, float, float], widths: list[float]
) -> None:
    grips = grips_of(box(*size), ARM)
    assert sorted(grips) == widths
    closing = {tuple(np.abs(r[:, 1]).round()) for _, part in every(grips) for r in part.rotation}
    assert len(closing) == sum(side <= ARM.fingers.grasp_width for side in size[:2])


def test_what_is_too_wide_on_all_sides_is_held_at_top_and_bottom() -> None:
    grips = grips_of(box(0.2, 0.15, 0.02), ARM)
    assert sorted(grips) == [0.02]
    frames = [rotation for _, part in every(grips) for rotation in part.rotation]
    assert {tuple(frame[:, 0].round().tolist()) for frame in frames} == {
        *((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
    }
    assert all(abs(frame[2, 1]) == pytest.approx(1.0) for frame in frames)


SIZES = [(0.15, 0.07, 0.10), (0.05, 0.04, 0.07), (0.025, 0.025, 0.025), (0.2, 0.15, 0.02)]


@pytest.mark.parametrize("size", SIZES)
def test_verification_accepts_every_grip(size: tuple[float, float, float]) -> None:
    body = box(*size)
    placement = pose((0.0, 0.0, 0.0)).tolist()
    for _, part in every(grips_of(body, ARM)):
        assert len(part)
        for rotation, offset in zip(part.rotation, part.offset, strict=True):
            tool = [*offset.tolist(), *quaternion(rotation).tolist()]
            assert grasp_faults(ARM, "red", body.convex, placement, tool) == []


def test_a_cylinder_is_held_all_around() -> None:
    can = box(0.06, 0.06, 0.12).model_copy(update={"shape": "cylinder"})
    placement, headings = pose((0.0, 0.0, 0.0), 0.3).tolist(), set[int]()
    for _, part in every(grips_of(can, ARM)):
        for rotation, offset in zip(part.rotation, part.offset, strict=True):
            tool = compose(np.array(placement), np.array([*offset, *quaternion(rotation)]))
            assert grasp_faults(ARM, "red", can.convex, placement, tool.tolist()) == []
            headings.add(round(np.degrees(np.arctan2(*rotation[:2, 1])) % 180, 1))
            beside = compose(tool, pose((0.0, 0.01, 0.0)))
            assert grasp_faults(ARM, "red", can.convex, placement, beside.tolist())
    assert sorted(headings) == [22.5 * step for step in range(8)]


def test_some_grips_are_from_above_some_from_the_sides_some_by_the_fingertips_only() -> None:
    _, others = grips_of(box(0.15, 0.07, 0.10), ARM)[0.07]
    down = others.rotation[:, 2, 0]
    assert down.min() == pytest.approx(-1.0)
    assert down.max() == pytest.approx(0.0, abs=1e-9)
    from_above = others.offset[down < -0.999, 2]
    assert from_above.max() == pytest.approx(0.05 - 0.003)  # their tips 3 mm below the box's top


@pytest.mark.parametrize(("width", "opening"), [(0.025, 0.045), (0.07, 0.09), (0.085, 0.09005)])
def test_a_hand_opens_as_far_as_the_box_asks(width: float, opening: float) -> None:
    assert ARM.fingers.opening_for(width) == pytest.approx(opening, abs=1e-5)
    assert ARM.fingers.opening(ARM.fingers.value_around(width)) == pytest.approx(opening, abs=1e-5)
    assert opening <= width + 2 * CLEARANCE + 1e-9


def variants(*boxes: Box, lid: float | None = None) -> Variants:
    tables = [TABLE]
    if lid is not None:
        tables.append(TABLE.model_copy(update={"name": "lid", "position": (0.54, 0.3, lid)}))
    scene = Scene(tables=tuple(tables), boxes=boxes)
    return Variants(SceneGeometry(scene), parse_skeleton("(grasp pr2L red) (place pr2L red tab)"))


def starts(choices: Variants, kept: Variant, count: int = 9) -> list[Variant]:
    return [
        choices.tried(number, cache(partial(np.random.default_rng, number)), kept)
        for number in range(count)
    ]


def test_a_box_with_one_pair_of_sides_leaves_nothing_to_choose() -> None:
    generator = np.random.default_rng(0)
    before = generator.bit_generator.state
    found = {
        variants(box(0.15, 0.07, 0.10)).tried(n, lambda: generator, Variant()) for n in range(9)
    }
    assert found == {Variant((0, 0), (0, 0))}
    assert generator.bit_generator.state == before  # so that other choices stay what they were


def test_starts_try_both_pairs_of_sides_the_narrower_first() -> None:
    found = starts(variants(box(0.05, 0.04, 0.07)), Variant())
    assert found[0].sides == (0, 0)
    assert {one.sides for one in found[1::2]} == {(0, 0), (1, 0)}


def test_what_is_kept_of_a_prefix_stays_in_every_other_start() -> None:
    found = starts(variants(box(0.05, 0.04, 0.07), lid=0.9), Variant((1,), (0,)))
    assert all(one.sides == (1, 0) and one.low[0] == 0 for one in found[1::2])
    assert {one.low[1] for one in found[1::2]} == {0, 1}


def test_only_what_is_below_something_has_a_low_way() -> None:
    below = variants(box(0.15, 0.07, 0.10), lid=0.9)
    above = variants(box(0.15, 0.07, 0.10), lid=0.4)
    assert {one.low for one in starts(below, Variant())} > {(0, 0)}
    assert {one.low for one in starts(above, Variant())} == {(0, 0)}


def test_where_places_are_given_all_choices_meet() -> None:
    """Of a box with two pairs of sides in a shelf; where nothing is left, the number stays."""
    choices = variants(box(0.05, 0.04, 0.07), lid=0.9)
    assert (choices.starts(2), choices.starts(12)) == (8, 12)
    found = starts(choices, Variant(), choices.starts(2))
    assert {(one.sides[0], one.low[0]) for one in found[1::2]} == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert variants(box(0.15, 0.07, 0.10)).starts(2) == 2
