"""Demonstrations from search: what is right and what is infeasible at every state of a plan.

Where sequences are too many to be enumerated, A* with facts finds one of the shortest plans. Every
applicable action at each of its states is tried: it is infeasible, or it begins a plan as short, or
neither is known. Some states are left by a random feasible action first, so that the policy learns
to find back.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.cases.declared import DeclaredCase, declared_case
from guided_lgp.cases.policies import demonstrations_of
from guided_lgp.cases.shards import run_kept
from guided_lgp.logic import (
    Action,
    Objective,
    Skeleton,
    applicable_actions,
    format_objective,
    progress,
    satisfied,
    unsatisfied,
)
from guided_lgp.params import BoundsParams, Params, SearchLimits
from guided_lgp.policy.relational.encoding import situation
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.tensors import write_tensors
from guided_lgp.robots import load_robot
from guided_lgp.scene import Scene
from guided_lgp.search import best_first
from guided_lgp.search.informed import FactsOfPairs
from guided_lgp.search.observation import observe, shapes, start
from guided_lgp.search.problem import Problem

_TRIALS = 8
"""Coarse calls after which it stays open whether an action begins a plan as short."""
_DETOURS = 1
"""States per objective that are left by a random feasible action."""

Row = dict[str, Any]

logger = logging.getLogger(__name__)


class CoarseBounds(SceneBounds):
    """The bounds of the NLP without the path: a sequence with a coarse bound counts as feasible."""

    def path(self, skeleton: Skeleton) -> PathResult:
        """The verdict of the coarse bound."""
        return PathResult(skeleton, self.coarse(skeleton).feasible)


@dataclass(frozen=True)
class Task:
    """One scene, with what is wanted there."""

    scene: Scene
    objectives: tuple[Objective, ...]
    index: int
    seed: int
    bounds: BoundsParams
    limits: SearchLimits


def run(params: Params, root: Path, name: str) -> None:
    """Write ``data/<case>/demonstrations.safetensors``."""
    case = declared_case(params, name)
    tasks = [(task, _content(task)) for task in _tasks(case, params)]
    folder = root / "data" / name
    shards = folder / ".demonstrations"
    description = f"{name}: demonstrations"
    parts = run_kept(demonstrate, tasks, shards, params.parallel, "demonstrate", description)
    rows = [row for part in parts for row in part]
    grippers = len(load_robot(case.params.robot).grippers)
    write_tensors(demonstrations_of(root, name), label_arrays(rows, grippers))
    logger.info("%s: %d states of %d scenes", name, len(rows), len(parts))


def _tasks(case: DeclaredCase, params: Params) -> Iterator[Task]:
    seed = case.params.demonstrations.seed
    for index, (scene, objectives) in enumerate(case.training()):
        yield Task(scene, tuple(objectives), index, seed, params.bounds, case.params.limits)


def _content(task: Task) -> Any:
    goals = [format_objective(objective) for objective in task.objectives]
    settings = task.bounds.model_dump(), task.limits.model_dump()
    return [task.scene.model_dump(mode="json"), goals, task.index, task.seed, *settings]


def demonstrate(task: Task) -> list[Row]:
    """The labelled states of one scene."""
    bounds = CoarseBounds(task.scene, task.bounds)
    rng = np.random.default_rng(np.random.SeedSequence((task.seed, task.index, 1)))
    rows = []
    for objective in task.objectives:
        teacher = _Teacher(task, objective, bounds)
        rows += list(teacher.states(()))
        for _ in range(_DETOURS):
            if away := teacher.detour(rng):
                rows += list(teacher.states(away))
    return rows


class _Teacher:
    """Finds plans, and says of every action what is known about it."""

    def __init__(self, task: Task, objective: Objective, bounds: CoarseBounds) -> None:
        self._task, self._bounds = task, bounds
        self._problem = Problem(task.scene, objective, task.limits, bounds, parts=bounds)
        self._facts = FactsOfPairs(self._problem, bounds)
        self._plan: Skeleton = ()

    def states(self, prefix: Skeleton) -> Iterator[Row]:
        """The labelled states of one of the shortest plans that begin with a sequence."""
        plan = self._shortest(prefix, self._task.limits.max_sequences, self._task.limits.max_depth)
        if plan is None:
            return
        self._plan = plan
        for length in range(len(prefix), len(plan)):
            yield self._labelled(plan[:length], plan)

    def detour(self, rng: np.random.Generator) -> Skeleton:
        """Part of the last plan, and a feasible action that does not belong to it."""
        if not self._plan:
            return ()
        before = self._plan[: rng.integers(len(self._plan))]
        others = [
            action
            for action in self._applicable(before)
            if action != self._plan[len(before)]
            and self._bounds.coarse((*before, action)).feasible
            and not self._reached((*before, action))
        ]
        return (*before, others[rng.integers(len(others))]) if others else ()

    def _labelled(self, before: Skeleton, plan: Skeleton) -> Row:
        right, wrong = [], []
        for action in self._applicable(before):
            child = (*before, action)
            if not self._bounds.coarse(child).feasible:
                wrong.append(action)
            elif child == plan[: len(child)] or self._as_short(child, len(plan)):
                right.append(action)
        return self._row(before, right, wrong)

    def _as_short(self, child: Skeleton, length: int) -> bool:
        return self._shortest(child, _TRIALS, length) is not None

    def _shortest(self, prefix: Skeleton, calls: int, depth: int) -> Skeleton | None:
        """One of the shortest plans that begin with a sequence, if it is found within limits."""
        if self._reached(prefix):
            return prefix
        limits = {"max_sequences": calls, "max_depth": depth}
        problem = replace(
            self._problem,
            prefix=prefix,
            limits=self._task.limits.model_copy(update=limits),
        )
        return best_first.plan_knowing(problem, self._facts).skeleton

    def _reached(self, skeleton: Skeleton) -> bool:
        state = progress(self._task.scene.state, skeleton)
        return satisfied(state, self._problem.objective)

    def _applicable(self, before: Skeleton) -> tuple[Action, ...]:
        state = progress(self._task.scene.state, before)
        return applicable_actions(state, self._task.scene.symbols)

    def _row(self, before: Skeleton, right: list[Action], wrong: list[Action]) -> Row:
        scene, symbols = self._task.scene, self._task.scene.symbols
        state = progress(scene.state, before)
        frame = self._bounds.coarse(before).after_action[-1] if before else start(scene)
        goals = unsatisfied(state, self._problem.objective)
        seen = situation(goals, state, observe(scene, frame), symbols, shapes(scene, frame))
        assert seen.shapes is not None
        return {
            "positions": np.round(seen.positions[0].astype(float), 5).tolist(),
            "shapes": np.round(seen.shapes[0].astype(float), 5).tolist(),
            "supports": seen.supports[0].tolist(),
            "goals": seen.goals[0].tolist(),
            "right": [_place(scene, action) for action in right],
            "wrong": [_place(scene, action) for action in wrong],
            "configuration": self._task.index,
        }


def _place(scene: Scene, action: Action) -> tuple[int, int]:
    """Gripper and node of an action."""
    symbols = scene.symbols
    target = heads(symbols.domain)[action.instruction].target_of(action)
    return symbols.grippers.index(action.symbols[0]), symbols.tables.index(target)


def label_arrays(rows: list[Row], grippers: int) -> dict[str, np.ndarray]:
    """The labelled states as arrays; actions by gripper and node, as the policy scores them."""
    nodes = len(rows[0]["positions"])
    labels = {
        name: np.zeros((len(rows), grippers, nodes), dtype=bool) for name in ("right", "wrong")
    }
    for name, places in labels.items():
        for number, row in enumerate(rows):
            for place in row[name]:
                places[number][tuple(place)] = True
    return {
        **{
            name: np.array([row[name] for row in rows], np.float32)
            for name in ("positions", "shapes")
        },
        **{name: np.array([row[name] for row in rows], np.int8) for name in ("supports", "goals")},
        **labels,
        "configuration": np.array([row["configuration"] for row in rows], np.int32),
    }
