"""Facts of tasks: proofs before a search, and what small parts of a scene say after one."""

import json
from pathlib import Path

import numpy as np
import pytest

from guided_lgp.bounds.deadline import Deadline, OutOfTimeError
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.params import load_planning
from guided_lgp.poses import pose, rotation_matrix
from guided_lgp.scene import Box, Scene, load_scene, parse_scene
from guided_lgp.scene.bodies import Obstacle
from guided_lgp.search.facts import TaskFacts
from guided_lgp.search.finding import KINDS, Finding

ROOT = Path(__file__).parents[2]
NEAR = load_scene(ROOT / "examples" / "three_boxes.json")
ROW = load_scene(ROOT / "tests" / "cases" / "touching_row.json")
FAR = load_scene(ROOT / "tests" / "cases" / "handover_only.json")


def facts(scene: Scene, *goals: str, deadline: float | None = None) -> TaskFacts:
    bounds = SceneBounds(scene, load_planning().bounds, Deadline.after(deadline))
    return TaskFacts(bounds, parse_objective(goals))


def resized(scene: Scene, **sizes: tuple[float, float, float]) -> Scene:
    """The scene with other sizes of some boxes, which still stand where they stood."""
    boxes = []
    for box in scene.boxes:
        size = sizes.get(box.name, box.size)
        x, y, z = box.position
        position = (x, y, z + (size[2] - box.size[2]) / 2)
        boxes.append(box.model_copy(update={"size": size, "position": position}))
    return scene.model_copy(update={"boxes": tuple(boxes)})


def found(finding: Finding | None) -> Finding:
    assert finding is not None
    assert finding.kind in KINDS
    assert finding.help
    return finding


def test_what_can_be_done_is_not_ruled_out() -> None:
    for goals in (["(on red green)", "(held blue)"], ["(on red tab2)", "(on green tab2)"]):
        assert facts(NEAR, *goals).before_search() is None
    assert facts(NEAR, "(on red tab2)").after_search() is None


def test_a_box_too_wide_is_told_before_a_search() -> None:
    wide = resized(NEAR, red=(0.15, 0.12, 0.1))
    finding = found(facts(wide, "(on red tab2)").before_search())
    assert finding.kind == "width"
    assert finding.text == "red is too wide for the fingers: 0.120 m at its narrowest side"
    assert facts(wide, "(on green tab1)").before_search() is None, "nobody wants red"


def test_what_fingertips_have_no_room_on() -> None:
    """Too flat a coin; a mesh with no parallel faces where its frame would have them."""
    flat = resized(NEAR, red=(0.03, 0.03, 0.005))
    assert found(facts(flat, "(on red tab2)").before_search()).text == (
        "red is too small for the fingers: they need 0.006 m of its sides either way"
    )
    plate = resized(NEAR, red=(0.14, 0.005, 0.12))
    assert facts(plate, "(on red tab2)").before_search() is None, "across its thickness"
    angles = np.arange(8) * np.pi / 4
    ring = np.stack([0.03 * np.cos(angles), 0.03 * np.sin(angles)], axis=1)
    prism = [[x, y, z] for x, y in ring.tolist() for z in (0.0, 0.1)]
    bodies = NEAR.model_dump(mode="json")
    bodies["boxes"][0] |= {"shape": "mesh", "vertices": prism, "position": [0.5, 0.25, 0.6]}
    finding = found(facts(parse_scene(bodies, "mine"), "(on red tab2)").before_search())
    assert finding.text.startswith("red has no two parallel faces, across its x or y, ")
    turn = rotation_matrix(pose(np.zeros(3), np.pi / 8)[3:])
    bodies["boxes"][0]["vertices"] = (np.array(prism) @ turn).tolist()
    assert facts(parse_scene(bodies, "mine"), "(on red tab2)").before_search() is None


def test_what_is_to_stay_level_and_is_not() -> None:
    """By default a hand holds its box from above; at its side it does not point down."""
    document = NEAR.model_dump(mode="json")
    document["boxes"][0] = {"name": "red", "size": [0.15, 0.07, 0.1], "on": "pr2L"}
    held = parse_scene(document, "mine")
    finding = found(facts(held, "(on red tab2)", "(upright red)").before_search())
    assert finding.kind == "tilted"
    assert finding.text.startswith("red is to stay level, and pr2L holds it tilted by 2.3")
    assert facts(held, "(on red tab2)", "(upright green)").before_search() is None


def test_boxes_too_tight_together() -> None:
    """No proof by discs, yet no arm puts both there."""
    tray = NEAR.tables[1].model_copy(update={"half_extents": (0.03, 0.03)})
    tight = NEAR.model_copy(update={"tables": (NEAR.tables[0], tray)})
    goals = [f"(on {name} tab2)" for name in ("red", "blue")]
    assert facts(tight, *goals).before_search() is None
    finding = found(facts(tight, *goals).after_search())
    assert finding.kind == "room"
    assert finding.text.startswith("no arm puts blue and red on tab2 together, ")


def test_no_room_for_two() -> None:
    broad = resized(NEAR, red=(0.15, 0.08, 0.1), blue=(0.15, 0.08, 0.1), green=(0.04, 0.03, 0.1))
    finding = found(facts(broad, "(on red green)", "(on blue green)").before_search())
    assert (finding.kind, finding.text.split(":")[0]) == (
        "room",
        "no room on green for blue and red",
    )
    assert "0.075 m apart at least, and can be 0.050 m at most" in finding.text
    assert facts(NEAR, "(on red green)", "(on blue green)").before_search() is None


def test_no_room_by_area() -> None:
    def standing(number: int) -> Box:
        return Box(name=f"b{number}", size=(0.2, 0.08, 0.1), position=(0.5, 0.3, 0.65), on="tab1")

    boxes = tuple(standing(number) for number in range(25))
    goals = [f"(on b{number} tab2)" for number in range(25)]
    many = NEAR.model_copy(update={"boxes": boxes})
    finding = found(facts(many, *goals).before_search())
    assert finding.kind == "room"
    assert "they cover 0.400 m²" in finding.text
    assert facts(many, *goals[:7]).before_search() is None


def roofed(room: float, **changes: object) -> Scene:
    """A shelf whose lid is some metres above its board; the box is 0.1 m high."""
    scene = load_scene(ROOT / "tests" / "cases" / "into_low_shelf.json")
    left, board, lid = scene.tables
    z = board.position[2] + room + 0.04
    moved = lid.model_copy(update={"position": (*lid.position[:2], z), **changes})
    return scene.model_copy(update={"tables": (left, board, moved)})


def test_no_room_below_something_low() -> None:
    finding = found(facts(roofed(0.09), "(on red board)").before_search())
    assert finding.kind == "room"
    assert finding.text.startswith("no room on board for red: it is 0.100 m high, and lid covers")
    assert finding.text.endswith("covers all of board 0.090 m above it")
    assert facts(roofed(0.11), "(on red board)").before_search() is None, "high enough"
    assert facts(roofed(0.09), "(on red left)").before_search() is None, "not below it"
    small = roofed(0.09, half_extents=(0.1, 0.1))
    assert facts(small, "(on red board)").before_search() is None, "beside the lid"
    turned = roofed(0.09, yaw=0.1)
    assert facts(turned, "(on red board)").before_search() is None, "at its corners"


def test_a_full_hand_may_be_emptied_first() -> None:
    document = json.loads((ROOT / "tests" / "cases" / "handover_only.json").read_text())
    document["boxes"].append({"name": "cube", "size": [0.05, 0.05, 0.05], "on": "pr2L"})
    task = facts(parse_scene(document, "full"), "(held parcel)")
    assert task.before_search() is None
    assert task.graspable_by("parcel") == ("pr2L",)
    assert task.reachable_by("parcel", "farleft") == ("pr2L",)


def test_a_body_in_a_hand_is_taken_already() -> None:
    document = json.loads((ROOT / "tests" / "cases" / "handover_only.json").read_text())
    document["boxes"] = [{"name": "parcel", "size": [0.15, 0.07, 0.1], "on": "pr2L"}]
    task = facts(parse_scene(document, "held"), "(on parcel farright)")
    assert task.graspable_by("parcel") == ("pr2L",)
    assert task.reachable_by("parcel", "farleft") == ("pr2L",)
    assert found(task.after_search()).kind == "way"


def test_who_reaches_what() -> None:
    task = facts(FAR, "(on parcel farright)")
    assert task.before_search() is None
    assert task.graspable_by("parcel") == ("pr2L",)
    assert task.reachable_by("parcel", "farleft") == ("pr2L",)
    assert task.reachable_by("parcel", "farright") == ()
    assert found(task.after_search()).kind == "way"


def panda(*, ahead: float, on: str = "near") -> Scene:
    """A table before the arm, another one farther ahead, and a box."""
    tops = {"near": (0.5, 0.25, 0.2), "far": (ahead, -0.25, 0.2)}
    tables = [
        {"name": name, "position": top, "half_extents": (0.15, 0.15)} for name, top in tops.items()
    ]
    position = (*tops[on][:2], 0.25)
    red = {"name": "red", "size": (0.12, 0.06, 0.1), "position": position, "on": on}
    return parse_scene({"robot": {"model": "panda"}, "tables": tables, "boxes": [red]}, "panda")


def test_no_arm_is_longer_than_its_links() -> None:
    """Also of arms that are not built like a human's."""
    finding = found(facts(panda(ahead=1.2), "(on red far)").before_search())
    assert (finding.kind, finding.text) == ("reach", "far is out of reach of the arm")
    assert facts(panda(ahead=0.7), "(on red far)").before_search() is None
    away = found(facts(panda(ahead=1.3, on="far"), "(on red near)").before_search())
    assert away.text == "red is out of reach of the arm"
    given = panda(ahead=1.2).boxes[0].model_copy(update={"grasps": ((0.9, 0, 0, 0, 0, 0, 1),)})
    scene = panda(ahead=1.2).model_copy(update={"boxes": (given,)})
    assert facts(scene, "(on red far)").before_search() is None, "a long handle"


def with_grasps(goal: str, *grasps: tuple[float, ...]) -> Finding | None:
    """What is known before a search of the near scene, its red box held in these ways alone."""
    red = NEAR.boxes[0].model_copy(update={"grasps": grasps})
    scene = NEAR.model_copy(update={"boxes": (red, *NEAR.boxes[1:])})
    return facts(scene, goal).before_search()


def test_given_grasps_may_be_out_of_reach() -> None:
    (from_above, long_handle), turn = ((0.0, 0.0, 0.02), (0.0, 0.0, 1.3)), (0, 0.70711, 0, 0.70711)
    red = NEAR.boxes[0].name
    assert with_grasps(f"(held {red})", (*from_above, *turn)) is None
    assert found(with_grasps(f"(held {red})", (*long_handle, *turn))).kind == "reach"
    assert with_grasps(f"(held {red})", (*long_handle, *turn), (*from_above, *turn)) is None


def test_full_hands_are_no_lack_of_reach() -> None:
    held = [
        {"name": name, "size": (0.15, 0.07, 0.1), "on": gripper}
        for name, gripper in (("x", "pr2L"), ("y", "pr2R"))
    ]
    document = NEAR.model_dump(mode="json")
    document["boxes"] = [document["boxes"][0], *held]
    assert facts(parse_scene(document, "full"), "(on red tab2)").before_search() is None


def test_boxes_that_block_each_other_are_named() -> None:
    finding = found(facts(ROW, "(on p2 right)").after_search())
    assert finding.kind == "blocked"
    assert "between p1, p2, p3" in finding.text
    p1, p2, p3 = ROW.boxes
    apart = p3.model_copy(update={"position": (0.54, 0.49, 0.65)})
    loose = ROW.model_copy(update={"boxes": (p1, p2, apart)})
    assert facts(loose, "(on p3 right)").after_search() is None


def test_a_box_between_others_that_no_hand_can_take() -> None:
    walls = resized(ROW, p1=(0.3, 0.12, 0.1), p3=(0.3, 0.12, 0.1))
    shift = {"p1": -0.025, "p3": 0.025}
    boxes = [
        box.model_copy(update={"position": (0.54, box.position[1] + shift.get(box.name, 0), 0.65)})
        for box in walls.boxes
    ]
    finding = found(
        facts(ROW.model_copy(update={"boxes": tuple(boxes)}), "(held p2)").after_search()
    )
    assert (finding.kind, finding.help) == ("blocked", "space between p1, p2, p3")


def test_obstacles_that_keep_all_arms_away_are_named() -> None:
    sides = (("near", -0.055), ("far", 0.055))
    walls = [
        Obstacle(name=name, size=(0.16, 0.03, 0.12), position=(0.54, 0.33 + y, 0.66))
        for name, y in sides
    ]
    lid = Obstacle(name="lid", size=(0.22, 0.15, 0.02), position=(0.54, 0.33, 0.735))
    beside = Obstacle(name="beside", size=(0.03, 0.03, 0.12), position=(0.54, 0.52, 0.66))
    p2 = next(box for box in ROW.boxes if box.name == "p2")
    body = p2.model_copy(update={"position": (0.54, 0.33, 0.65)})
    hidden = ROW.model_copy(update={"boxes": (body,), "obstacles": (*walls, lid, beside)})
    finding = found(facts(hidden, "(held p2)").after_search())
    assert finding.kind == "blocked"
    assert finding.text.startswith("near, far around p2: both arms fail to grasp it")
    assert finding.help == "space between p2 and near, far"


def test_the_part_of_a_sequence_that_cannot_be_done() -> None:
    task = facts(ROW, "(on p1 right)")
    finding = found(task.about(parse_skeleton("(grasp pr2L p1)")))
    assert finding.kind == "part"
    assert finding.text == "(grasp pr2L p1) cannot be done, even with p1 and p2 alone in the scene"


def test_the_limit_of_time_holds() -> None:
    with pytest.raises(OutOfTimeError):
        facts(ROW, "(on p2 right)", deadline=0.0).after_search()
