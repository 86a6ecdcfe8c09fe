"""One version of the planner as a process that measures what it is told, for ``against.py``.

Reads one request per line, a JSON list, and answers each with one line of JSON. It runs on the
sources in ``PYTHONPATH``, be it these or those of an older version, so it imports only what both
have, under either name. Times are CPU seconds of this process.
"""

import json
import re
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from guided_lgp.experiments import enumerate_sequences
from guided_lgp.logic import applicable_actions, successor
from guided_lgp.logic.objectives import satisfied, two_goal_objectives
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import generate
from guided_lgp.search.tree import LogicTree

PARAMETERS = load_params(SOURCES / "params.yaml")
SEED = 20_004
"""Of the scenes; no stage of the pipeline uses it."""
SCENES = 20
"""Configurations per setup."""


def either(*names: str) -> Any:
    """The first module of these that there is."""
    for name in names:
        try:
            return import_module(f"guided_lgp.{name}")
        except ModuleNotFoundError:
            continue
    raise ModuleNotFoundError(names[0])


bounds = either("bounds.scene_bounds", "nlp.bounds")
coarse = either("bounds.coarse", "nlp.coarse")
solvers = either("bounds.coarse.solver", "nlp.coarse.solver")


@cache
def scenes(setup: str) -> Any:
    """The configurations of a setup, the same ones in every version."""
    return generate(setup, SCENES, SEED, "bench").scenes


class Here:
    """The bounds of the scene that was asked for last."""

    def __init__(self, setup: str, number: int) -> None:
        self.place = setup, number
        self.scene = scenes(setup)[number]
        self.bounds = bounds.SceneBounds(self.scene, PARAMETERS.bounds)

    def skeleton(self, words: list[str]) -> Any:
        """The actions with these names."""
        state, actions = self.scene.state, []
        for word in words:
            by_name = {str(a): a for a in applicable_actions(state, self.scene.symbols)}
            actions.append(by_name[word])
            state = successor(state, actions[-1])
        return tuple(actions)


_here: list[Here] = []


def here(setup: str, number: int) -> Here:
    """The bounds of a scene."""
    if not _here or _here[0].place != (setup, number):
        _here[:] = [Here(setup, number)]
    return _here[0]


def choices(setup: str, number: int, words: list[str]) -> list[str]:
    """The actions that are applicable after others."""
    place = here(setup, number)
    state = place.scene.state
    for action in place.skeleton(words):
        state = successor(state, action)
    return [str(action) for action in applicable_actions(state, place.scene.symbols)]


def coarse_verdict(setup: str, number: int, words: list[str]) -> dict[str, Any]:
    """The coarse bound of a skeleton whose prefix is known."""
    place = here(setup, number)
    skeleton = place.skeleton(words)
    if len(skeleton) > 1:
        place.bounds.coarse(skeleton[:-1])
    began = time.process_time()
    result = place.bounds.coarse(skeleton)
    seconds = time.process_time() - began
    starts = result.restarts if hasattr(result, "restarts") else result.tries
    return {"feasible": result.feasible, "seconds": seconds, "starts": starts}


def path_verdict(setup: str, number: int, words: list[str]) -> dict[str, Any]:
    """The path bound of a skeleton whose coarse solution is known, its verification included."""
    place = here(setup, number)
    skeleton = place.skeleton(words)
    place.bounds.coarse(skeleton)
    getattr(place.bounds, "_path_bound", None)  # made when first asked for, since some version
    began = time.process_time()
    result = place.bounds.path(skeleton)
    return {"feasible": result.feasible, "seconds": time.process_time() - began}


def duration(setup: str, number: int, words: list[str]) -> dict[str, Any]:
    """How long (s) the motion of a skeleton takes, as a user of the version gets it."""
    place, users = here(setup, number), import_module("guided_lgp.explanation")
    found = place.bounds
    if hasattr(users, "users_bounds"):
        never = import_module("guided_lgp.bounds.deadline").NEVER
        given = (place.scene, PARAMETERS.bounds, never, ())
        found = users.users_bounds(*given, coordinate=True)
    result = found.path(place.skeleton(words))
    seconds = float(result.trajectory.times[-1]) if result.feasible else None
    return {"feasible": result.feasible, "duration_s": seconds}


def enumerated(setup: str, number: int) -> list[list[str]]:
    """The skeletons of all verdicts that the enumeration of a configuration asks for, in order."""
    with tempfile.TemporaryDirectory() as folder:
        shard = _shard(scenes(setup)[number], Path(folder))
        skeletons = pq.read_table(shard / "verdicts.parquet", columns=["skeleton"])["skeleton"]
        return [re.findall(r"\([^)]*\)", skeleton) for skeleton in skeletons.to_pylist()]


def keyframes(setup: str, number: int, words: list[str]) -> list[list[Any]]:
    """The coarse solution: joint values and box poses at every switch, then after every action."""
    place = here(setup, number)
    result = place.bounds.coarse(place.skeleton(words))
    names = ("at_switch", "after_action") if hasattr(result, "at_switch") else _FORMER
    return [[_plain(frame) for frame in getattr(result, name)] for name in names]


_FORMER = ("contacts", "retreated")
"""What keyframes were called."""


def _plain(frame: Any) -> Any:
    return frame.q.tolist(), {name: pose.tolist() for name, pose in frame.boxes.items()}


def refusal(
    setup: str, number: int, words: list[str], at_switch: Any, after_action: Any
) -> str | None:
    """The sort of constraint by which this version's verification refuses another's keyframes."""
    verify, results = import_module("guided_lgp.bounds.verify"), either("bounds.results")
    frames = [
        [
            results.Keyframe(np.array(q), {name: np.array(p) for name, p in boxes.items()})
            for q, boxes in given
        ]
        for given in (at_switch, after_action)
    ]
    world = import_module("guided_lgp.scene.world").world_of(scenes(setup)[number])
    found = verify.verify_keyframes(world, here(setup, number).skeleton(words), *frames)
    return None if found is None else _kind(found.constraint)


def _kind(constraint: str) -> str:
    """Of what sort it is, whatever it is about."""
    return "joint limit" if constraint.startswith("joint limit") else constraint.split()[0]


def enumeration(setup: str, number: int) -> dict[str, Any]:
    """All verdicts of one configuration, as the stage of the pipeline asks for them."""
    scene = scenes(setup)[number]
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        shard = _shard(scene, Path(folder))
        seconds = time.process_time() - began
        rows = pq.read_metadata(shard / "verdicts.parquet").num_rows
    return {"verdicts": rows, "seconds": seconds}


def whole_plan(setup: str, number: int, goals: list[str]) -> dict[str, Any]:
    """The default planner, from reading the goals to the verified motion."""
    place, planning = Here(setup, number), import_module("guided_lgp.planning")
    began = time.process_time()
    result = planning.plan(place.scene, goals)
    return {"feasible": result.path is not None, "seconds": time.process_time() - began}


def open_goals(setup: str, number: int) -> list[list[str]]:
    """All pairs of goals that do not hold yet."""
    scene = scenes(setup)[number]
    pairs = two_goal_objectives(scene.symbols)
    return [list(map(str, pair)) for pair in pairs if not satisfied(scene.state, pair)]


def best_plan(setup: str, number: int, goals: list[str], candidates: int) -> dict[str, Any]:
    """How long (s) the motion of a plan takes, the best of some where the version compares them."""
    planning = import_module("guided_lgp.planning")
    compares = "candidates" in signature(planning.plan).parameters
    options = {"candidates": candidates} if compares else {}
    path = planning.plan(scenes(setup)[number], goals, **options).path
    return {
        "feasible": path is not None,
        "duration_s": None if path is None else float(path.trajectory.times[-1]),
    }


def _shard(scene: Any, folder: Path) -> Path:
    """The tables of one configuration, as the stage writes them."""
    given: dict[str, Any] = {
        "limits": PARAMETERS.enumerate_sequences,
        "bounds": PARAMETERS.bounds,
    }
    if "sources" in enumerate_sequences.Task.__annotations__:
        given["sources"] = ""
    task = enumerate_sequences.Task(scene, **given, folder=folder)
    enumerate_sequences.write_shard(task)
    return task.shard


def logic_tree(setup: str, number: int, nodes: int) -> dict[str, Any]:
    """The first nodes of the logic tree, breadth-first, as the baseline generates them."""
    scene, node = scenes(setup)[number], 0
    began = time.process_time()
    tree = LogicTree(scene.symbols, scene.state)
    while len(tree) < nodes:
        tree.expand(node)
        node += 1
    return {"nodes": len(tree), "seconds": time.process_time() - began}


class Recorder:
    """A solver that remembers the last program."""

    def __init__(self, solver: Any) -> None:
        self._solver = solver

    def __getattr__(self, name: str) -> Any:
        return getattr(self._solver, name)

    def solve(self, program: Any, values: Any, settings: Any, *kept: int) -> Any:
        """As the solver does, which may be told to leave the first variables where they are."""
        self.last = program, np.array(values)
        return self._solver.solve(program, values, settings, *kept)


def step(setup: str, number: int, words: list[str], steps: int) -> dict[str, Any]:
    """Seconds per step of the solver on the program of a skeleton, off its solution."""
    place = here(setup, number)
    skeleton = place.skeleton(words)
    robot = getattr(place.scene.robot, "description", None)
    solver = solvers.default_solver(*([] if robot is None else [robot]))
    recorder = Recorder(solver)
    bound = coarse.CoarseBound(place.scene, 1, recorder)
    bound.solve(skeleton, place.bounds.coarse(skeleton[:-1]))
    program, values = recorder.last
    noise = np.random.default_rng(0).normal(scale=0.1, size=len(program.lower))
    values[: len(noise)] = np.clip(values[: len(noise)] + noise, program.lower, program.upper)
    endless = replace(solvers.Settings(), tolerance=-1.0, steps=steps, patience=steps)
    began = time.process_time()
    solution = solver.solve(program, values, endless)
    seconds = (time.process_time() - began) / solution.steps
    return {"seconds": seconds, "variables": program.variables, "rows": program.rows}


REQUESTS: dict[str, Callable[..., Any]] = {
    "choices": choices,
    "coarse": coarse_verdict,
    "enumerated": enumerated,
    "keyframes": keyframes,
    "refusal": refusal,
    "path": path_verdict,
    "duration": duration,
    "enumeration": enumeration,
    "step": step,
    "logic_tree": logic_tree,
    "plan": whole_plan,
    "open_goals": open_goals,
    "best": best_plan,
}

if __name__ == "__main__":
    answers = sys.stdout
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        with redirect_stdout(sys.stderr):
            answer = REQUESTS[name](*arguments)
        print(json.dumps(answer), file=answers, flush=True)
