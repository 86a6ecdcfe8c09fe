"""Whether plans can be carried out: limits, physics, friction, towers, closed loop.

Writes ``reports/metrics/execution.json`` after every part, and ``docs/execution_results.md`` from
it. Needs nothing that the pipeline makes:

    python benchmarks/execution.py [--count N] [PART ...]

With parts named, the figures of the others stay.
"""

import argparse
import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np

from guided_lgp import parallel, plan
from guided_lgp.bounds.coordination import Coordinator
from guided_lgp.bounds.execution import Conditions, execute
from guided_lgp.bounds.execution.conditions import AS_PLANNED
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.joints import rows_outside_limits
from guided_lgp.clearance import clearance_of
from guided_lgp.documents import read_json, write_json
from guided_lgp.experiments.problems import tower
from guided_lgp.logic import Skeleton, State, applicable_actions, successor
from guided_lgp.params import load_params
from guided_lgp.paths import METRICS, PARAMS
from guided_lgp.poses import compose, pose
from guided_lgp.replanning import Course, Laboratory, follow
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate
from path import goals_after

ROOT = Path(__file__).parents[1]
FILE = ROOT / METRICS / "execution.json"
PAGE = ROOT / "docs" / "execution_results.md"
SEED = 30_000
"""Of scenes and sequences; no stage of the pipeline uses it."""
DRAWS = 500
"""Random sequences that are looked at, at most, for one that is wanted and feasible."""
FRICTIONS = (0.6, 1.0)
NOISE_M, CLOSED_LOOP_NOISE_M = 0.005, 0.008
KINDS = ("moved", "dropped", "taken away")
HANDS = {"both_arms": 2, "one_arm": 1}
LIMITS = ("joint limit", "velocity", "acceleration", "jerk", "effort")

logger = logging.getLogger("execution")


@dataclass(frozen=True)
class Planned:
    """A random plan as shipped."""

    course: Course
    in_turn_s: float
    """How long the same actions take one after the other, with all ways home."""


def planned(length: int, number: int, wanted: Callable[[Scene, Skeleton], bool]) -> Planned | None:
    """A random feasible sequence of setup a, planned; the same for everyone."""
    (scene,) = generate("a", 1, SEED + number, f"execution-{number:03d}").scenes
    rng = np.random.default_rng([SEED, length, number])
    bounds = SceneBounds(scene, load_params(ROOT / PARAMS).bounds)
    for _ in range(DRAWS):
        skeleton = _drawn(scene, length, rng)
        if wanted(scene, skeleton) and bounds.coarse(skeleton).feasible:
            in_turn = bounds.path(skeleton)
            path = Coordinator(scene).shorten(in_turn) if in_turn.feasible else in_turn
            if path.trajectory is not None and in_turn.trajectory is not None:
                goals = goals_after(scene.state, skeleton)
                shipped = Course(scene, goals, path.skeleton, path.trajectory)
                return Planned(shipped, float(in_turn.trajectory.times[-1]))
    return None


def _drawn(scene: Scene, length: int, rng: np.random.Generator) -> Skeleton:
    state, skeleton = scene.state, ()
    for _ in range(length):
        actions = list(applicable_actions(state, scene.symbols))
        skeleton = (*skeleton, actions[int(rng.integers(len(actions)))])
        state = successor(state, skeleton[-1])
    return skeleton


def states(scene: Scene, skeleton: Skeleton) -> Iterator[State]:
    """Before, between and after the actions."""
    state = scene.state
    yield state
    for action in skeleton:
        state = successor(state, action)
        yield state


def anything(scene: Scene, skeleton: Skeleton) -> bool:
    """Every sequence."""
    return True


def loaded(scene: Scene, skeleton: Skeleton) -> bool:
    """Whether a hand carries boxes on the one that it holds."""
    return any(s.standing_on(box) for s in states(scene, skeleton) for box, _ in s.held)


def single(scene: Scene, skeleton: Skeleton) -> bool:
    """Whether no hand does."""
    return not loaded(scene, skeleton)


@dataclass(frozen=True)
class Task:
    """One plan under some conditions."""

    number: int
    length: int = 4
    wanted: Callable[[Scene, Skeleton], bool] = anything
    conditions: Conditions = AS_PLANNED


def carried_out(task: Task) -> dict[str, Any] | None:
    """What becomes of a random plan."""
    drawn = planned(task.length, task.number, task.wanted)
    if drawn is None:
        return None
    found = drawn.course
    motion = (found.scene, found.skeleton, found.trajectory)
    report = execute(found.scene, found.objective, *motion[1:], task.conditions)
    q, times = _moving(found), found.trajectory.times
    rows = switches_of(*motion)
    assert isinstance(rows, list)
    outside = rows_outside_limits(found.scene, found.skeleton, rows, q, times)
    return {
        "scene": found.scene.name,
        "actions": list(map(str, found.skeleton)),
        "succeeded": report.success,
        "fault": report.fault,
        "drift_mm": round(1000 * report.drift, 2),
        "rows_outside_limits": outside,
        "waiting_s": waiting(found, q),
        "duration_s": float(times[-1]),
        "duration_ratio": float(times[-1]) / drawn.in_turn_s,
        "hands": len({action.symbols[0] for action in found.skeleton}),
        "clearance_mm": round(1000 * clearance_of(*motion).distance, 2),
    }


def _moving(found: Course) -> Array:
    return found.trajectory.joints(found.scene.robot.description.moving_joints)


def waiting(found: Course, q: Array) -> float:
    """How long (s) no arm moves."""
    arms = len(found.scene.robot.description.joint_names)
    still = ~np.any(np.diff(q[:, :arms], axis=0), axis=1)
    return float(np.diff(found.trajectory.times)[still].sum())


def built(setup: str, conditions: Conditions, closed: bool, number: int) -> dict[str, Any] | None:
    """What becomes of the tower of all boxes of a setup."""
    (scene,) = generate(setup, 1, SEED + number, f"{setup}-{number:03d}").scenes
    found = plan(scene, list(map(str, tower(scene.symbols.boxes, "tray"))), timeout=300)
    if found.path is None or found.path.trajectory is None:
        return None
    path, trajectory = found.path, found.path.trajectory
    if closed:
        way = Course(found.scene, found.objective, path.skeleton, trajectory)
        report = follow(way, conditions, timeout=60).report
    else:
        report = execute(found.scene, found.objective, path.skeleton, trajectory, conditions)
    return {"scene": scene.name, "succeeded": report.success, "fault": report.fault}


def disturbed(number: int) -> dict[str, Any] | None:
    """What becomes of a plan in closed loop when a box is moved, dropped or taken away."""
    drawn, kind = planned(4, number, single), KINDS[number % len(KINDS)]
    if drawn is None:
        return None
    rng = np.random.default_rng([SEED, number])
    report = follow(drawn.course, disturb=partial(_disturb, kind, rng), timeout=60).report
    return {
        "scene": drawn.course.scene.name,
        "kind": kind,
        "succeeded": report.success or bool(report.fault),
        "fault": report.fault,
    }


def _disturb(kind: str, rng: np.random.Generator, world: Laboratory, made: int) -> None:
    if made > 1:
        return
    held = world.held()
    if kind == "dropped" and held:
        world.drop(sorted(held.values())[0])
        return
    free = sorted(set(world.boxes()) - held.keys())
    box = free[int(rng.integers(len(free)))]
    angle = rng.uniform(0, 2 * np.pi)
    shift = (0.05 * np.cos(angle), 0.05 * np.sin(angle), 0.0)
    away = pose((5.0, 0.0, -1.0)) if kind == "taken away" else None
    world.put(box, compose(pose(shift), world.boxes()[box]) if away is None else away)


def counted(rows: list[dict[str, Any] | None]) -> dict[str, Any]:
    """How many plans there were, and how many succeeded."""
    found = [row for row in rows if row is not None]
    return {
        "plans": len(found),
        "succeeded": sum(row["succeeded"] for row in found),
        "faults": sorted(row["fault"] for row in found if not row["succeeded"]),
    }


def plans(count: int) -> dict[str, Any]:
    """Random plans as shipped: limits, waiting, clearance and physics."""
    tasks = [Task(number, length=(4, 6, 8)[number % 3]) for number in range(count)]
    rows = [row for row in _run(carried_out, tasks, "plans") if row is not None]
    kinds = {kind: sum(r["rows_outside_limits"][kind] for r in rows) for kind in LIMITS}
    return {
        "plans": len(rows),
        "succeeded": sum(row["succeeded"] for row in rows),
        "rows_outside_limits": sum(kinds.values()),
        "rows_outside_by_kind": kinds,
        "duration_ratio": {name: _ratios(rows, hands) for name, hands in HANDS.items()},
        "waiting_share": fmean(row["waiting_s"] / row["duration_s"] for row in rows),
        "smallest_clearance_mm": min(row["clearance_mm"] for row in rows),
    }


def _ratios(rows: list[dict[str, Any]], hands: int) -> dict[str, float] | None:
    """Of the durations of plans with so many hands and those of the same actions in turn."""
    ratios = [row["duration_ratio"] for row in rows if row["hands"] == hands]
    return {"median": median(ratios), "worst": max(ratios)} if ratios else None


def under_friction(
    count: int, wanted: Callable[[Scene, Skeleton], bool], friction: float, noise: float = 0.0
) -> dict[str, Any]:
    """Random plans with friction alone."""
    conditions = Conditions("friction", friction, noise=noise)
    tasks = [Task(number, wanted=wanted, conditions=conditions) for number in range(count)]
    return counted(_run(carried_out, tasks, f"friction {friction}"))


def towers(count: int) -> dict[str, Any]:
    """Towers of eight and of ten, as shipped."""
    return {
        height: counted(_run(partial(built, setup, AS_PLANNED, False), range(count), setup))
        for height, setup in (("8", "e8"), ("10", "e10"))
    }


def closed_loop(count: int) -> dict[str, Any]:
    """Towers of five with noise, in closed loop, and in open loop beside it."""
    noisy = Conditions(noise=CLOSED_LOOP_NOISE_M)
    closed = counted(_run(partial(built, "d", noisy, True), range(count), "closed loop"))
    opened = counted(_run(partial(built, "d", noisy, False), range(count), "open loop"))
    return closed | {"open_loop": opened}


def _run(function: Callable[[Any], Any], tasks: Any, title: str) -> list[Any]:
    return parallel.run(function, list(tasks), load_params(ROOT / PARAMS).parallel, title)


MEASURES: Mapping[str, Callable[[int], dict[str, Any]]] = {
    "shipped": plans,
    "friction": lambda count: {
        str(mu): under_friction(2 * count // 3, single, mu) for mu in FRICTIONS
    },
    "friction_loaded": lambda count: under_friction(count // 3, loaded, FRICTIONS[0]),
    "friction_noise_5mm": lambda count: under_friction(count // 3, single, FRICTIONS[0], NOISE_M),
    "towers": lambda count: towers(count // 6),
    "closed_loop_8mm": lambda count: closed_loop(count // 3),
    "disturbed": lambda count: counted(_run(disturbed, range(count // 3), "disturbed")),
}
"""By part, what measures it, given the number of random plans."""


_TITLES = {
    "friction_loaded": "friction alone, hands that carry boxes on a box",
    "friction_noise_5mm": "friction alone, boxes misplaced by 5 mm",
    "closed_loop_8mm": "towers of five, boxes misplaced by 8 mm, in closed loop",
    "disturbed": "closed loop, a box moved, dropped or taken away: survived or named",
}


def page(figures: Mapping[str, Any]) -> str:
    """The page of the figures."""
    rows = [("random plans as shipped", figures)]
    rows += [(f"friction alone, μ = {mu}", f) for mu, f in figures.get("friction", {}).items()]
    rows += [(title, figures[key]) for key, title in _TITLES.items() if key in figures]
    rows += [(f"towers of {n}", cell) for n, cell in figures.get("towers", {}).items()]
    lines = [f"| {title} | {cell['succeeded']} | {cell['plans']} |" for title, cell in rows if cell]
    table = "\n".join(["| | succeeded | plans |", "| :--- | ---: | ---: |", *lines])
    shares = (
        f"Rows outside any limit, from positions to jerk: {figures['rows_outside_limits']}. No arm "
        f"moves in {100 * figures['waiting_share']:.0f} % of the time. Smallest distance from what "
        f"is not touched: {figures['smallest_clearance_mm']:.1f} mm.\n"
    )
    origin = (
        "Generated from `reports/metrics/execution.json`, which `make verify-execution` writes."
    )
    return f"# Plans carried out\n\n{origin}\n\n{table}\n\n{shares}"


def main() -> None:
    """Measure some parts, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="random plans")
    parser.add_argument("parts", nargs="*", choices=[[], *MEASURES], metavar="PART")
    given = parser.parse_args()
    figures = read_json(FILE, "an earlier run of all parts") if given.parts else {}
    for name in given.parts or MEASURES:
        measured = MEASURES[name](given.count)
        figures |= measured if name == "shipped" else {name: measured}
        logger.info("%s: %s", name, measured)
        write_json(FILE, figures)
    PAGE.write_text(page(figures), encoding="utf-8")


if __name__ == "__main__":
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    main()
