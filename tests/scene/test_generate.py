"""Generated configurations: where boxes stand, and what the random streams depend on."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from guided_lgp.errors import InputError
from guided_lgp.scene import Scene, generate, load_scenes
from guided_lgp.scene.footprints import footprint, gap, inset
from guided_lgp.scene.setups import CLEARANCE


@pytest.mark.parametrize(
    ("setup", "boxes"), [("a", 3), ("b", 3), ("c", 4), ("d", 5), ("e6", 6), ("e8", 8), ("e10", 10)]
)
def test_boxes_stand_wholly_on_their_tables_and_apart(setup: str, boxes: int) -> None:
    clearance = CLEARANCE if setup == "a" else 0.005
    for scene in generate(setup, 10, seed=1, prefix="x").scenes:
        tables = {table.name: table for table in scene.tables}
        assert len(scene.boxes) == boxes
        for box in scene.boxes:
            assert np.min(inset(footprint(tables[box.on]), footprint(box))) >= 0
            assert box.position[2] - box.size[2] / 2 == pytest.approx(tables[box.on].position[2])
        for one, other in combinations(scene.boxes, 2):
            assert gap(footprint(one), footprint(other)) >= clearance


def test_only_setup_a_varies_the_table() -> None:
    starts = {
        setup: {box.on for scene in generate(setup, 20, 3, "x").scenes for box in scene.boxes}
        for setup in "abcd"
    }
    assert starts["a"] == {"tab1", "tab2"}
    assert starts["b"] == starts["c"] == starts["d"] == {"tab1"}


@pytest.mark.parametrize("setup", ["e6", "e8", "e10"])
def test_many_boxes_start_in_turn_on_both_tables_beyond_the_other_arm(setup: str) -> None:
    for scene in generate(setup, 10, 3, "x").scenes:
        assert [box.on for box in scene.boxes] == ["tab1", "tab2"] * (len(scene.boxes) // 2)
        assert all(abs(box.position[1]) > 0.3 for box in scene.boxes)


def test_more_configurations_leave_the_earlier_ones_as_they_were() -> None:
    few, many = generate("a", 3, 7, "train"), generate("a", 6, 7, "train")
    assert many.scenes[:3] == few.scenes
    assert len({scene.boxes for scene in many.scenes}) == 6


def test_seeds_and_setups_have_streams_of_their_own() -> None:
    assert generate("a", 1, 1, "x").scenes != generate("a", 1, 2, "x").scenes
    b, c = generate("b", 1, 1, "x").scenes[0], generate("c", 1, 1, "x").scenes[0]
    assert b.boxes != c.boxes[:3]


def test_rejected_draws_are_counted() -> None:
    seen: list[Scene] = []

    def every_third(scene: Scene) -> bool:
        seen.append(scene)
        return len(seen) % 3 == 0

    result = generate("a", 4, 1, "x", accept=every_third)
    assert result.rejected == 8
    assert list(result.scenes) == seen[2::3]


def test_the_file_holds_the_same_scenes_and_the_same_bytes(tmp_path: Path) -> None:
    result = generate("d", 2, 1, "x")
    result.save(tmp_path / "one.json")
    generate("d", 2, 1, "x").save(tmp_path / "two.json")
    assert load_scenes(tmp_path / "one.json") == result
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "two.json").read_bytes()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("{", "is not JSON"),
        ("[" * 100_000, "is nested too deeply"),
        ("[]", "is of version None"),
        ('{"version": 2}', "is of version 2"),
        ('{"version": 1}', "setup: unknown setup None"),
        ('{"version": 1, "setup": 7, "scenes": [], "rejected": 0}', "setup: unknown setup 7"),
        ('{"version": 1, "setup": "a", "scenes": 5, "rejected": 0}', "scenes: is not a list"),
        ('{"version": 1, "setup": "a", "scenes": [], "rejected": 0}', "scenes: is not a list"),
        ('{"version": 1, "setup": "a", "scenes": [1], "rejected": true}', "rejected: is not"),
        (
            '{"version": 1, "setup": "a", "scenes": [1], "rejected": 0}',
            r"scenes\.0: 1 is not a mapping",
        ),
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, fault: str) -> None:
    path = tmp_path / "scenes.json"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"scenes\.json: {fault}") as error:
        load_scenes(path)
    assert "\n" not in str(error.value)


def test_a_missing_file_names_the_stage(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="generate_scenes"):
        load_scenes(tmp_path / "none.json")


def test_unknown_setup() -> None:
    with pytest.raises(InputError, match="accepted: a, b, c, d"):
        generate("z", 1, 1, "x")


@pytest.mark.parametrize(
    ("offset", "expected"),
    [((2.0, 0.0), 1.0), ((4.0, 5.0), 5.0), ((0.9, 0.5), -0.1)],
    ids=["face to face", "corner to corner, 3-4-5", "overlap"],
)
def test_gap_of_rectangles(offset: tuple[float, float], expected: float) -> None:
    square = np.array([[1.0, 1], [0, 1], [0, 0], [1, 0]])
    assert gap(square, np.add(square, offset)) == pytest.approx(expected)
