"""Whether plans can be carried out: limits, physics, friction, towers, closed loop.

Writes ``reports/metrics/execution.json`` after every part, and ``docs/execution_results.md`` from
it. Needs nothing that the pipeline makes:

    python benchmarks/execution.py [--count N] [PART ...]

With parts named, the figures of the others stay. A run that was interrupted goes on where it was.
"""

import argparse
import json
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

import duration
from execution_page import PARTS, page
from guided_lgp import parallel, plan
from guided_lgp.bounds.deadline import NEVER
from guided_lgp.bounds.execution import Conditions, execute
from guided_lgp.bounds.execution.conditions import AS_PLANNED
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.joints import rows_outside_limits
from guided_lgp.clearance import clearance_of
from guided_lgp.documents import read_json, write_json
from guided_lgp.experiments.problems import tower
from guided_lgp.explanation import users_bounds
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
ROWS = ROOT / ".cache" / "execution"
"""What has been measured so far, a line per task; gone when all is done."""
SEED = 30_000
"""Of scenes and sequences; no stage of the pipeline uses it."""
DRAWS = 500
"""Random sequences that are looked at, at most, for one that is wanted and feasible."""
FRICTIONS = (0.6, 1.0)
NOISE_M, CLOSED_LOOP_NOISE_M = 0.005, 0.008
MOVED_M = 0.05
AWAY = pose((5.0, 0.0, -1.0))
"""Where nobody sees a box any more."""
KINDS = ("moved", "dropped", "taken away")
NO_PLAN: dict[str, Any] = {"succeeded": False, "fault": "no plan"}
LIMITS = ("joint limit", "velocity", "acceleration", "jerk", "effort")


def planned(length: int, number: int, wanted: Callable[[Scene, Skeleton], bool]) -> Course | None:
    """A random feasible sequence of setup a, planned; the same for everyone."""
    (scene,) = generate("a", 1, SEED + number, f"execution-{number:03d}").scenes
    rng = np.random.default_rng([SEED, length, number])
    bounds = users_bounds(scene, load_params(ROOT / PARAMS).bounds, NEVER, (), coordinate=True)
    for _ in range(DRAWS):
        skeleton = _drawn(scene, length, rng)
        if wanted(scene, skeleton) and bounds.coarse(skeleton).feasible:
            path = bounds.path(skeleton)
            if path.trajectory is not None:
                goals = goals_after(scene.state, skeleton)
                return Course(scene, goals, path.skeleton, path.trajectory)
    return None


def _drawn(scene: Scene, length: int, rng: np.random.Generator) -> Skeleton:
    state = scene.state
    skeleton: Skeleton = ()
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
    """A random plan, and conditions under which it is carried out."""

    number: int
    length: int = 4
    wanted: Callable[[Scene, Skeleton], bool] = anything
    conditions: tuple[Conditions, ...] = (AS_PLANNED,)


def carried_out(task: Task) -> list[dict[str, Any]]:
    """What becomes of a random plan, under each of the conditions; empty if there is none."""
    found = planned(task.length, task.number, task.wanted)
    return [] if found is None else [_outcome(found, c) for c in task.conditions]


def _outcome(found: Course, conditions: Conditions) -> dict[str, Any]:
    motion = (found.skeleton, found.trajectory)
    report = execute(found.scene, found.objective, *motion, conditions)
    return {
        "scene": found.scene.name,
        "actions": list(map(str, found.skeleton)),
        "succeeded": report.success,
        "fault": report.fault,
        "drift_mm": round(1000 * report.drift, 2),
    }


def shipped(task: Task) -> dict[str, Any] | None:
    """What a random plan keeps to, and what becomes of it."""
    found = planned(task.length, task.number, task.wanted)
    if found is None:
        return None
    motion = (found.scene, found.skeleton, found.trajectory)
    q, times = _moving(found), found.trajectory.times
    rows = switches_of(*motion)
    assert isinstance(rows, list)
    return _outcome(found, AS_PLANNED) | {
        "rows_outside_limits": rows_outside_limits(found.scene, found.skeleton, rows, q, times),
        "waiting_s": waiting(found, q),
        "duration_s": float(times[-1]),
        "clearance_mm": round(1000 * clearance_of(*motion).distance, 2),
    }


def _moving(found: Course) -> Array:
    return found.trajectory.joints(found.scene.robot.description.moving_joints)


def waiting(found: Course, q: Array) -> float:
    """How long (s) no arm moves."""
    arms = len(found.scene.robot.description.joint_names)
    still = ~np.any(np.diff(q[:, :arms], axis=0), axis=1)
    return float(np.diff(found.trajectory.times)[still].sum())


def built(setup: str, number: int) -> dict[str, Any]:
    """What becomes of the tower of all boxes of a setup."""
    found = _tower(setup, number)
    return NO_PLAN if found is None else _outcome(found, AS_PLANNED)


def built_with_noise(number: int) -> dict[str, Any]:
    """What becomes of a tower of five from misplaced boxes, in closed and in open loop."""
    found = _tower("d", number)
    if found is None:
        return {"closed": NO_PLAN, "open": NO_PLAN}
    noisy = Conditions(noise=CLOSED_LOOP_NOISE_M, seed=number)
    report = follow(found, noisy, timeout=60).report
    closed = {"succeeded": report.success, "fault": report.fault}
    return {"scene": found.scene.name, "closed": closed, "open": _outcome(found, noisy)}


def _tower(setup: str, number: int) -> Course | None:
    """The plan of a tower as a user gets it."""
    (scene,) = generate(setup, 1, SEED + number, f"{setup}-{number:03d}").scenes
    found = plan(scene, list(map(str, tower(scene.symbols.boxes, "tray"))), timeout=300)
    if found.path is None or found.path.trajectory is None:
        return None
    return Course(found.scene, found.objective, found.path.skeleton, found.path.trajectory)


def disturbed(number: int) -> dict[str, Any] | None:
    """What becomes of a plan in closed loop when a box is moved, dropped or taken away."""
    drawn = planned(4, number, single)
    if drawn is None:
        return None
    disturbance = Disturbance(KINDS[number % len(KINDS)], np.random.default_rng([SEED, number]))
    followed = follow(drawn, disturb=disturbance, timeout=60)
    if not disturbance.done:
        return None
    report = followed.report
    return {
        "scene": drawn.scene.name,
        "kind": disturbance.kind,
        "survived": report.success,
        "succeeded": report.success or bool(report.fault),
        "fault": report.fault,
        "decisions": followed.decisions,
    }


@dataclass
class Disturbance:
    """Lays hands on a box, once: at the first look at which that can be done."""

    kind: str
    rng: np.random.Generator
    done: bool = False

    def __call__(self, world: Laboratory, made: int) -> None:
        """Look whether there is such a box."""
        held = world.held()
        dropped = self.kind == "dropped"
        boxes = sorted(held if dropped else set(world.boxes()) - held.keys())
        if self.done or not boxes:
            return
        self.done = True
        box = boxes[int(self.rng.integers(len(boxes)))]
        if dropped:
            world.drop(held[box])
        elif self.kind == "moved":
            angle = self.rng.uniform(0, 2 * np.pi)
            shift = pose((MOVED_M * np.cos(angle), MOVED_M * np.sin(angle), 0.0))
            world.put(box, compose(shift, world.boxes()[box]))
        else:
            world.put(box, AWAY)


def counted(rows: Iterable[dict[str, Any] | None]) -> dict[str, Any]:
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
    rows = [row for row in _run(shipped, tasks, "plans") if row is not None]
    kinds = {kind: sum(r["rows_outside_limits"][kind] for r in rows) for kind in LIMITS}
    return counted(rows) | {
        "rows_outside_limits": sum(kinds.values()),
        "rows_outside_by_kind": kinds,
        "waiting_share": fmean(row["waiting_s"] / row["duration_s"] for row in rows),
        "smallest_clearance_mm": min(row["clearance_mm"] for row in rows),
    }


def friction(count: int) -> dict[str, Any]:
    """Random plans with friction alone, as planned; every other one with boxes misplaced, too."""
    exact = tuple(Conditions("friction", mu) for mu in FRICTIONS)
    tasks = [
        Task(n, wanted=single, conditions=(*exact, _misplacing(n)) if n % 2 else exact)
        for n in range(2 * count // 3)
    ]
    rows = _run(carried_out, tasks, "friction")
    by_friction = {
        str(mu): counted(row[place] for row in rows if row) for place, mu in enumerate(FRICTIONS)
    }
    noisy = counted(row[-1] for row in rows if len(row) > len(FRICTIONS))
    return {"friction": by_friction, "friction_noise_5mm": noisy}


def _misplacing(number: int) -> Conditions:
    return Conditions("friction", FRICTIONS[0], noise=NOISE_M, seed=number)


def friction_loaded(count: int) -> dict[str, Any]:
    """Random plans with friction alone in which hands carry boxes on the ones that they hold."""
    conditions = (Conditions("friction", FRICTIONS[0]),)
    tasks = [Task(n, wanted=loaded, conditions=conditions) for n in range(count // 3)]
    rows = chain.from_iterable(_run(carried_out, tasks, "loaded"))
    return {"friction_loaded": counted(rows)}


def towers(count: int) -> dict[str, Any]:
    """Towers of eight and of ten, as shipped."""
    numbers = range(count // 6)
    rows = {n: _run(partial(built, f"e{n}"), numbers, f"towers_{n}") for n in ("8", "10")}
    return {"towers": {height: counted(found) for height, found in rows.items()}}


def closed_loop(count: int) -> dict[str, Any]:
    """Towers of five with noise, in closed loop, and in open loop beside it."""
    rows = _run(built_with_noise, range(count // 3), "closed_loop")
    opened = counted(row["open"] for row in rows)
    return {"closed_loop_8mm": counted(row["closed"] for row in rows) | {"open_loop": opened}}


def disturbances(count: int) -> dict[str, Any]:
    """Random plans in closed loop with a box moved, dropped or taken away."""
    rows = [row for row in _run(disturbed, range(count // 3), "disturbed") if row is not None]
    return {"disturbed": counted(rows) | {"survived": sum(row["survived"] for row in rows)}}


def durations(count: int) -> dict[str, Any]:
    """How long plans take, as a share of those of the version that all are measured against."""
    return {"duration_ratio": duration.measure(count // 2)}


def _run(function: Callable[[Any], Any], tasks: Sequence[Any], title: str) -> list[Any]:
    """The rows of all tasks; an interrupted run goes on where it was."""
    file = ROWS / f"{title}.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = list(map(json.loads, file.read_text().splitlines())) if file.exists() else []
    settings = load_params(ROOT / PARAMS).parallel
    with file.open("a", encoding="utf-8") as lines:
        for row in parallel.stream(function, list(tasks)[len(rows) :], settings, title):
            rows.append(row)
            print(json.dumps(row), file=lines, flush=True)
    return rows


MEASURES: Mapping[str, Callable[[int], dict[str, Any]]] = {
    "towers": towers,
    "loaded": friction_loaded,
    "friction": friction,
    "plans": plans,
    "closed_loop": closed_loop,
    "disturbed": disturbances,
    "duration": durations,
}
"""By part, what measures it, given the number of random plans."""


def main() -> None:
    """Measure some parts, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="random plans")
    parser.add_argument("parts", nargs="*", choices=[[], *MEASURES], metavar="PART")
    given = parser.parse_args()
    figures = read_json(FILE, "figures of an earlier run") if FILE.exists() else {}
    for name in given.parts or MEASURES:
        figures |= MEASURES[name](given.count)
        write_json(FILE, figures)
        for file in ROWS.glob(f"{name}*"):
            file.unlink()
    if figures.keys() >= PARTS:
        PAGE.write_text(page(figures), encoding="utf-8")


if __name__ == "__main__":
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    main()
