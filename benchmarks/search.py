"""Benchmark of the planners: logic tree, orderings of best-first search, enumeration.

Run after the pipeline, which makes the scenes and the models: python benchmarks/search.py
"""

import json
import sys
import time
from pathlib import Path
from statistics import fmean
from typing import Any

from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.logic import one_goal_objectives, two_goal_objectives
from guided_lgp.nlp.bounds import SceneBounds
from guided_lgp.params import Params, load_params
from guided_lgp.paths import PARAMS, SCENES, TRAINED
from guided_lgp.policy.inference import load_policy
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search import best_first, guided
from guided_lgp.search.best_first import Ordering
from guided_lgp.search.enumerate import enumerate_sequences
from guided_lgp.search.tree import LogicTree

ORDERINGS: tuple[Ordering, ...] = ("cumulative", "discrepancy")


def measure(root: Path) -> dict[str, Any]:
    """All figures, for the first configuration of each setup."""
    params = load_params(root / PARAMS)
    scenes = {
        setup: load_scenes(root / SCENES / f"scalability_{setup}.json").scenes[0]
        for setup in "abcd"
    }
    return {
        "logic_tree_nodes_per_s": _logic_tree(scenes["d"], params),
        "enumeration_verdicts_per_s": _enumeration(scenes["a"], params),
        "orderings": _orderings(scenes, params, root),
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


def _orderings(scenes: dict[str, Scene], params: Params, root: Path) -> dict[str, Any]:
    """Greedy and both orderings of best-first: means over the objectives of each problem."""
    policy = load_policy(root / TRAINED)
    figures = {}
    for problem in PROBLEMS:
        scene = scenes[problem.setup]
        symbols = scene.symbols
        bounds = SceneBounds(scene, params.bounds)
        objectives = problem.objectives(symbols.boxes)
        limits = params.compare_scalability
        results = {
            "guided": [
                guided.plan(scene, objective, symbols, bounds, policy, limits)
                for objective in objectives
            ]
        }
        for ordering in ORDERINGS:
            results[ordering] = [
                best_first.plan(
                    scene, objective, symbols, bounds, policy, limits, ordering=ordering
                )
                for objective in objectives
            ]
        figures[problem.name] = {
            planner: {
                "solved": sum(result.solved for result in found),
                "expansions": fmean(result.expansions for result in found),
                "tree_size": fmean(result.tree_size for result in found),
                "time_s": fmean(result.times.total for result in found),
            }
            for planner, found in results.items()
        }
    return figures


if __name__ == "__main__":
    json.dump(measure(Path(__file__).parents[1]), sys.stdout, indent=1)
    sys.stdout.write("\n")
