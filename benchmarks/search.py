"""Benchmark of the planners: logic tree, enumeration, and what the policy adds to the search.

Run after the pipeline, which makes the scenes and the models: python benchmarks/search.py
"""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import fmean
from typing import Any

from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.logic import Objective, one_goal_objectives, two_goal_objectives
from guided_lgp.nlp.bounds import SceneBounds
from guided_lgp.params import Params, load_params
from guided_lgp.paths import PARAMS, SCENES, TRAINED
from guided_lgp.policy.inference import POLICIES, load_policy
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search import best_first, guided
from guided_lgp.search.enumerate import enumerate_sequences
from guided_lgp.search.policy import Policy, Uniform
from guided_lgp.search.result import SearchResult
from guided_lgp.search.tree import LogicTree


def measure(root: Path) -> dict[str, Any]:
    """All figures, for the first configuration of each setup."""
    params = load_params(root / PARAMS)
    scenes = {
        setup: load_scenes(root / SCENES / f"scalability_{setup}.json").scenes[0]
        for setup in {problem.setup for problem in PROBLEMS}
    }
    return {
        "logic_tree_nodes_per_s": _logic_tree(scenes["d"], params),
        "enumeration_verdicts_per_s": _enumeration(scenes["a"], params),
        "policies": _policies(scenes, params, root),
    }


def _logic_tree(scene: Scene, params: Params) -> float:
    tree = LogicTree(scene.symbols, scene.state)
    start = time.perf_counter()
    node = 0
    while len(tree) < params.compare_scalability.max_tree_size:
        tree.expand(node)
        node += 1
    return len(tree) / (time.perf_counter() - start)


def _enumeration(scene: Scene, params: Params) -> float:
    """Verified verdicts per second on one core, compilation left out."""
    objectives = one_goal_objectives(scene.symbols) + two_goal_objectives(scene.symbols)
    limits = params.enumerate_sequences
    for _ in range(2):  # the first round compiles
        bounds = SceneBounds(scene, params.bounds)
        start = time.perf_counter()
        found = enumerate_sequences(
            scene.state, scene.symbols, objectives, bounds, limits.max_length, limits.slack
        )
        elapsed = time.perf_counter() - start
    return len(found.verdicts) / elapsed


def _policies(scenes: dict[str, Scene], params: Params, root: Path) -> dict[str, Any]:
    """Greedy and best-first by each policy, and best-first without: means over the objectives."""
    policies = {name: load_policy(root / TRAINED, name) for name in POLICIES}
    limits = params.compare_scalability
    figures = {}
    for problem in PROBLEMS:
        scene = scenes[problem.setup]
        bounds = SceneBounds(scene, params.bounds)
        objectives = problem.objectives(scene.symbols.boxes)

        def solve(
            plan: Callable[..., SearchResult],
            policy: Policy,
            scene: Scene = scene,
            bounds: SceneBounds = bounds,
            objectives: list[Objective] = objectives,
        ) -> dict[str, float]:
            found = [
                plan(scene, objective, scene.symbols, bounds, policy, limits)
                for objective in objectives
            ]
            return {
                "solved": sum(result.solved for result in found),
                "expansions": fmean(result.expansions for result in found),
                "tree_size": fmean(result.tree_size for result in found),
                "time_s": fmean(result.times.total for result in found),
            }

        figures[problem.name] = {"uniform_best_first": solve(best_first.plan, Uniform())} | {
            f"{name}_{search}": solve(plan, policy)
            for name, policy in policies.items()
            for search, plan in (("greedy", guided.plan), ("best_first", best_first.plan))
        }
    return figures


if __name__ == "__main__":
    json.dump(measure(Path(__file__).parents[1]), sys.stdout, indent=1)
    sys.stdout.write("\n")
