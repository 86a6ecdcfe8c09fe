"""Families of random problems: reproducible, as their rules say, and never drawn for ever."""

from pathlib import Path

import pytest

from guided_lgp.errors import InputError
from guided_lgp.scene import families
from guided_lgp.scene.families import draw_problems, family, family_names, find_family
from guided_lgp.scene.families.rows import Rows, chain
from guided_lgp.scene.validate import validate_scene


@pytest.mark.parametrize("name", family_names())
@pytest.mark.parametrize("size", [3, 5])
def test_problems_are_valid_and_follow_the_rules(name: str, size: int) -> None:
    declared = find_family(name)
    layout = declared.layout()
    for drawn in draw_problems(declared, layout, size, 3, 1, "test"):
        validate_scene(drawn.scene, name)
        assert len(drawn.scene.boxes) == size
        assert all(rule(layout, drawn) for rule in declared.rules.values())
        assert not any(drawn.scene.state.satisfies(goal) for goal in drawn.objective)


def test_more_problems_leave_the_first_as_they_were() -> None:
    rows = find_family("rows")
    few, more = (draw_problems(rows, Rows(), 4, count, 1, "test") for count in (2, 4))
    assert more[:2] == few
    assert len({drawn.scene.model_copy(update={"name": ""}) for drawn in more}) == 4


def test_names_and_sizes_and_seeds_give_other_problems() -> None:
    rows = find_family("rows")
    streams = [(4, 1, "test"), (4, 1, "training"), (4, 2, "test")]
    places = {
        tuple(
            box.position for box in draw_problems(rows, Rows(), size, 1, seed, name)[0].scene.boxes
        )
        for size, seed, name in streams
    }
    assert len(places) == 3


def test_with_decoys_the_tallest_stays() -> None:
    decoys = find_family("rows_decoys")
    for drawn in draw_problems(decoys, decoys.layout(), 4, 5, 1, "test"):
        moved = chain(decoys.layout(), drawn.scene, drawn.objective[0].symbols[0])
        heights = {box.name: box.size[2] for box in drawn.scene.boxes}
        assert max(heights[name] for name in moved) < max(heights.values())


def test_a_family_that_rejects_everything_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(family, "MAX_DRAWS", 50)
    never = r"family rows: no acceptable scene of 3 boxes in 50 draws .*a neighbour blocks .*50 of"
    with pytest.raises(InputError, match=never):
        draw_problems(find_family("rows"), Rows(blocking_gap=0.001), 3, 1, 1, "test")


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(InputError, match=r"unknown family 'heaps' .*rows, rows_decoys"):
        find_family("heaps")


def test_a_file_without_its_family_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "heaps.py").write_text("from guided_lgp.scene.families.rows import FAMILY")
    monkeypatch.setattr(families, "__path__", [*families.__path__, str(tmp_path)])
    with pytest.raises(InputError, match=r"heaps\.py: FAMILY: is missing or has another name"):
        find_family("heaps")
    with pytest.raises(InputError, match=r"unknown family 'piles' \(accepted: heaps, rows, "):
        find_family("piles")
