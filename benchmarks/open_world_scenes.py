"""Scenes of thirteen kinds that people's situations produce, two thirds meant to be solvable.

Every third scene has one planted fault, which a proof that knows no planner confirms: lengths
against the reach of an arm, widths against a hand, discs and heights against the room there is.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from guided_lgp.scene import Box, PlacedRobot, Scene, Table, parse_scene
from guided_lgp.scene.bodies import Obstacle
from guided_lgp.scene.footprints import footprint, gap

SEED = 20_006
"""Of the scenes; no stage of the pipeline uses it."""
FAULT = 3
"""Every scene of so many has a planted fault."""
SHOULDER, ARM = (-0.05, 0.0, 1.07), 1.45
"""Between the PR2's shoulders, and more than any point of its hands is ever away from there (m)."""
HAND = 0.09
"""More than the PR2's hand can close on (m)."""
SIZE = (0.15, 0.07, 0.1)
GAP = 0.06
"""Between boxes of a clutter (m)."""

Rng = np.random.Generator


@dataclass(frozen=True)
class Case:
    """A scene with its goals; of a fault, the findings that are a right reason for it."""

    kind: str
    number: int
    scene: Scene
    goals: tuple[str, ...]
    fault: tuple[str, ...] = ()


def cases(kind: str, number: int) -> Case:
    """One scene of a kind."""
    rng = np.random.default_rng([SEED, list(KINDS).index(kind), number])
    planted = number % FAULT == 0
    bodies, goals, fault = KINDS[kind](rng, planted)
    tables, boxes, obstacles, robots = (
        [b for b in bodies if type(b) is wanted] for wanted in (Table, Box, Obstacle, PlacedRobot)
    )
    document = {
        "name": f"{kind}-{number}",
        "tables": [table.model_dump() for table in tables],
        "boxes": [box.model_dump() for box in boxes],
        "obstacles": [obstacle.model_dump() for obstacle in obstacles],
    }
    for robot in robots:
        document["robot"] = robot.model_dump()
    scene = parse_scene(document, f"{kind}-{number}")
    return Case(kind, number, scene, goals, fault if planted else ())


Drawn = tuple[list[Table | Box | Obstacle | PlacedRobot], tuple[str, ...], tuple[str, ...]]


def _table(name: str, x: float, y: float, z: float = 0.6, yaw: float = 0.0) -> Table:
    return Table(name=name, position=(x, y, z), half_extents=(0.17, 0.2), yaw=yaw)


def _left_and_right() -> tuple[Table, Table]:
    return _table("left", 0.54, 0.33), _table("right", 0.54, -0.33)


def _on(
    below: Table | Box,
    name: str,
    size: tuple[float, float, float] = SIZE,
    at: tuple[float, float] | None = None,
    yaw: float = 0.0,
    shape: str = "box",
) -> Box:
    """A box on a table, at a place in the world or in its middle."""
    x, y = below.top[:2] if at is None else at
    position = (float(x), float(y), below.top[2] + size[2] / 2)
    return Box.model_validate(
        {"name": name, "size": size, "position": position, "yaw": yaw, "on": below.name}
        | ({} if shape == "box" else {"shape": shape})
    )


def _out_of_reach(table: Table) -> tuple[str, ...]:
    """The proof: the nearest point of a table's top, with a box, is further than an arm reaches."""
    radius = math.hypot(*table.half_extents) + math.hypot(*SIZE)
    assert math.dist(table.top, SHOULDER) - radius > ARM
    return ("reach",)


def _too_wide(box: Box) -> tuple[str, ...]:
    assert min(box.size[:2]) > HAND
    return ("width",)


def shelves(rng: Rng, planted: bool) -> Drawn:
    left, board = _table("left", 0.5, 0.35), _table("board", 0.58, -0.3)
    room = SIZE[2] - 0.01 if planted else rng.uniform(0.24, 0.45)
    roof = _table("roof", 0.58, -0.3, board.top[2] + room + 0.04)
    red = _on(left, "red", at=(0.5, 0.35 + rng.uniform(-0.1, 0.1)), yaw=rng.uniform(-0.5, 0.5))
    return [left, board, roof, red], ("(on red board)",), ("way", "part", "room")


def rows(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    space = 0.0 if planted else rng.uniform(0.04, 0.08)
    names = ("p1", "p2", "p3")
    boxes = [
        _on(left, name, at=(0.54, 0.33 + (number - 1) * (0.07 + space)))
        for number, name in enumerate(names)
    ]
    assert planted == all(gap(footprint(a), footprint(b)) < 1e-6 for a, b in pairwise(boxes))
    return [left, right, *boxes], ("(on p2 right)",), ("blocked",)


def stacks(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    a = _on(left, "a", size=(0.15, 0.12, 0.1) if planted else SIZE, yaw=rng.uniform(-0.3, 0.3))
    b = _on(a, "b", yaw=a.yaw)
    c = _on((left, right)[0 if planted else rng.integers(2)], "c", at=None)
    if c.on == "left":
        c = _on(left, "c", at=(0.54, 0.18))
    goals = ("(on a c)",) if planted else (("(on b c)", "(on a b)"), ("(on c a)",))[rng.integers(2)]
    return [left, right, a, b, c], goals, _too_wide(a) if planted else ()


def clutter(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    boxes: list[Box] = []
    for _ in range(200):
        table = (left, right)[rng.integers(2)]
        size = (rng.uniform(0.06, 0.12), rng.uniform(0.04, 0.08), rng.uniform(0.06, 0.14))
        if planted and not boxes:
            table, size = left, (0.13, 0.11, 0.1)
        at = np.array(table.top[:2]) + rng.uniform(-1, 1, 2) * (0.12, 0.15)
        box = _on(table, f"b{len(boxes)}", size, (at[0], at[1]), rng.uniform(-1.5, 1.5))
        if all(gap(footprint(box), footprint(other)) > GAP for other in boxes):
            boxes.append(box)
    goal = f"(on b0 {'right' if boxes[0].on == 'left' else 'left'})"
    return [left, right, *boxes], (goal,), _too_wide(boxes[0]) if planted else ()


def heights(rng: Rng, planted: bool) -> Drawn:
    left = _table("left", 0.52, 0.35, rng.uniform(0.5, 0.75))
    right = _table("right", 0.52, -0.35, 2.9 if planted else rng.uniform(0.5, 0.75))
    fault = _out_of_reach(right) if planted else ()
    return [left, right, _on(left, "red", yaw=rng.uniform(-1, 1))], ("(on red right)",), fault


def turned(rng: Rng, planted: bool) -> Drawn:
    left = _table("left", 0.54, 0.35, yaw=rng.uniform(-1.5, 1.5))
    right = _table("right", 2.4 if planted else 0.54, -0.35, yaw=rng.uniform(-1.5, 1.5))
    red = _on(left, "red", yaw=rng.uniform(-1.5, 1.5))
    return [left, right, red], ("(on red right)",), _out_of_reach(right) if planted else ()


def obstacles(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    red = _on(left, "red")
    if not planted:
        x, y = rng.uniform(0.66, 0.7), rng.uniform(-0.1, 0.1)
        wall = Obstacle(name="wall", size=(0.04, 0.2, 0.4), position=(x, y, 0.8))
        return [left, right, red, wall], ("(on red right)",), ()
    walls = [  # on all sides and above, nearer than a finger is thick
        Obstacle(name=name, size=size, position=(0.54 + x, 0.33 + y, 0.66 + z))
        for name, size, (x, y, z) in (
            ("front", (0.03, 0.15, 0.12), (-0.095, 0.0, 0.0)),
            ("back", (0.03, 0.15, 0.12), (0.095, 0.0, 0.0)),
            ("near", (0.16, 0.03, 0.12), (0.0, -0.055, 0.0)),
            ("far", (0.16, 0.03, 0.12), (0.0, 0.055, 0.0)),
            ("lid", (0.22, 0.15, 0.02), (0.0, 0.0, 0.075)),
        )
    ]
    return [left, right, red, *walls], ("(on red right)",), ("reach", "blocked")


def shapes(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    width = 0.12 if planted else rng.uniform(0.04, 0.075)
    can = _on(left, "can", (width, width, rng.uniform(0.08, 0.15)), shape="cylinder")
    return [left, right, can], ("(on can right)",), _too_wide(can) if planted else ()


def small(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    side = 0.025 if planted else rng.uniform(0.025, 0.04)
    base = _on(right, "base", (side, side, side))
    sides = (0.06, 0.06) if planted else (side, side)
    cubes = [_on(left, f"c{i}", (s, s, s), (0.54, 0.24 + 0.15 * i)) for i, s in enumerate(sides)]
    goals = ("(on c0 base)", "(on c1 base)") if planted else ("(on c0 base)", "(on c1 right)")
    assert planted == (sum(sides) / 2 - 0.01 > math.hypot(side, side))  # discs of both, 5 mm deep
    return [left, right, base, *cubes], goals, ("room",)


def hands(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    gripper = ("pr2L", "pr2R")[rng.integers(2)]
    red = Box.model_validate({"name": "red", "size": SIZE, "on": gripper})
    far = _table("far", 2.4, 0.0)
    goals = ("(on red far)",) if planted else ("(on red right)", "(on green red)")
    bodies = [left, right, far, red, _on(left, "green", yaw=rng.uniform(-0.5, 0.5))]
    return bodies, goals, _out_of_reach(far) if planted else ()


def lids(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    width = rng.uniform(0.13, 0.16)
    at = (rng.uniform(0.44, 0.52), rng.uniform(0.25, 0.35))
    pot = _on(left, "pot", (width, width, 0.12), at, shape="cylinder")
    wide = width if planted else width + rng.uniform(0.06, 0.08)
    lid = _on(pot, "lid", (wide, wide, 0.02), at, shape="cylinder")
    assert lid.size[0] > HAND  # and planted: no finger gets below it
    return [left, right, pot, lid], ("(on lid right)",), ("width",) if planted else ()


HOLDS_OUT = dict(
    zip(
        (
            *("l_shoulder_pan_joint", "l_shoulder_lift_joint", "l_upper_arm_roll_joint"),
            *("l_elbow_flex_joint", "l_forearm_roll_joint", "l_wrist_flex_joint"),
            "l_wrist_roll_joint",
        ),
        (1.460348, 1.065283, 2.017675, -1.768497, -1.973801, -0.596159, 1.511368),
        strict=True,
    )
)
"""The left arm holds a tray level with its middle at (0.5, 0.3, 0.71), deep in the hand."""
DEEP = (0.072, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def carried(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    size, far = (0.15, 0.07, 0.06), _table("far", 2.4, 0.0)
    tray = Box.model_validate({"name": "tray", "size": size, "on": "pr2L", "grasp": DEEP})
    cup = _on(left, "cup", size, at=(0.5 + rng.uniform(-0.03, 0.03), 0.3))
    cup = cup.model_copy(update={"on": "tray", "position": (*cup.position[:2], 0.77)})
    can = _on(right, "can", size, (0.5, -0.3), rng.uniform(-0.5, 0.5))
    goals = ("(on tray right)", "(on cup right)", "(on can cup)", "(on tray can)")
    goal = "(on tray far)" if planted else goals[rng.integers(len(goals))]
    robot = PlacedRobot(joints=HOLDS_OUT)
    bodies = [robot, left, right, far, tray, cup, can]
    return bodies, (goal,), _out_of_reach(far) if planted else ()


def swaps(rng: Rng, planted: bool) -> Drawn:
    left, right = _left_and_right()
    size = (0.13, 0.11, 0.1) if planted else (0.12, 0.06, 0.1)
    turns = rng.uniform(-0.3, 0.3, 2)
    a = _on(left, "a", size, (0.5, 0.25), float(turns[0]))
    b = _on(left, "b", (0.12, 0.06, 0.1), (0.5, 0.42), float(turns[1]))
    goals = tuple(
        f"(at {one.name} left {other.position[0]} {other.position[1]} 0.65 {other.yaw:.3f})"
        for one, other in ((a, b), (b, a))
    )
    return [left, right, a, b], goals, _too_wide(a) if planted else ()


KINDS: Mapping[str, Callable[[Rng, bool], Drawn]] = {
    one.__name__: one
    for one in (
        *(shelves, rows, stacks, clutter, heights),
        *(turned, obstacles, shapes, small, hands),
        *(lids, carried, swaps),
    )
}
"""Every kind, by its name."""
