"""The outputs of all earlier stages with made-up figures, so that the report can be rendered."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from guided_lgp.bounds.results import Attachment, PathResult, Trajectory
from guided_lgp.documents import write_json
from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.logic import (
    Skeleton,
    applicable_actions,
    format_objective,
    format_skeleton,
    one_goal_objectives,
    successor,
    two_goal_objectives,
)
from guided_lgp.paths import EVALUATION, METRICS, SCENES, SEQUENCES, TRAINING
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.robots import load_robot
from guided_lgp.scene import Scene, generate
from guided_lgp.tables import write_table

TREE: dict[str, tuple[float | None, ...]] = {
    "breadth_first": (400.0, 3000.0, 44000.0, 216000.0, *[None] * 6),
    "guided": (24.0, 46.0, 47.0, 99.0, 97.0, 140.0, 116.0, 300.0, 900.0, 2500.0),
    "guided_best_first": (24.0, 50.0, 47.0, 95.0, 98.0, 130.0, 118.0, 290.0, 800.0, 2400.0),
    "improved": (24.0, 44.0, 47.0, 93.0, 96.0, 130.0, 115.0, 290.0, 700.0, 2000.0),
    "improved_best_first": (24.0, 43.0, 47.0, 92.0, 97.0, 120.0, 117.0, 280.0, 690.0, 1900.0),
    "relational": (24.0, 43.0, 47.0, 92.0, 96.0, 110.0, 115.0, 200.0, 320.0, 480.0),
    "relational_best_first": (24.0, 42.0, 47.0, 91.0, 96.0, 109.0, 115.0, 198.0, 318.0, 470.0),
    "breadth_first_graph": (150.0, 40.0, 700.0, 5200.0, 9000.0, 60000.0, 150000.0, *[None] * 3),
    "uniform_best_first": (50.0, 90.0, 120.0, 400.0, 700.0, 900.0, 2000.0, *[None] * 3),
    "astar": (60.0, 120.0, 90.0, 300.0, 260.0, 900.0, 800.0, 2000.0, 9000.0, None),
}
"""Tree size by planner, in the order of the problems; None: stopped at the limit."""

CLASSES = {
    "action": ("grasp", "place"),
    "instruction": ("grasp", "place"),
    "gripper": ("pr2L", "pr2R"),
    "box": ("red", "green", "blue"),
    "table": ("tab1", "tab2", "red", "green", "blue"),
}


def write_outputs(root: Path) -> None:
    """Write what the stages before render_reports write, below a folder."""
    rng = np.random.default_rng(0)
    setups = list(dict.fromkeys(problem.setup for problem in PROBLEMS))
    sets = {"training": "a", "test": "a"} | {f"scalability_{s}": s for s in setups}
    scenes = {}
    for number, (name, setup) in enumerate(sets.items()):
        kept = generate(setup, 2, number, name.replace("_", "-"))
        kept.save(root / SCENES / f"{name}.json")
        scenes[name] = kept.scenes
    for split in ("training", "test"):
        rows = [row for scene in scenes[split] for row in _verdicts(scene, rng)]
        write_table(root / SEQUENCES / f"{split}.parquet", pa.Table.from_pylist(rows))
    _write_generalization(root, scenes["test"], rng)
    _write_scalability(root, {setup: scenes[f"scalability_{setup}"] for setup in setups})
    chains = {f"{network}.json": chain for network, chain in Encoding().chains.items()}
    chains |= {f"improved/{file}": chain for file, chain in chains.items()}
    for file, chain in (chains | {"relational.json": ("action",)}).items():
        sub_policies = {name: _training(CLASSES[name], rng) for name in chain}
        report = {"version": 1, "seed": 5, "samples": 1000, "sub_policies": sub_policies}
        write_json(root / TRAINING / file, report)


def geometry() -> dict[str, dict[str, float]]:
    """Figures as ``make bench`` writes them."""
    return {
        str(length): {
            "coarse_median_ms": 0.6 * length,
            "coarse_first_try": 0.8,
            "false_infeasible": 0.01,
            "infeasible_share": 0.2,
            "path_verified_share": 0.97,
            "path_median_s": 0.2 * length,
            "physics_success_share": 0.98,
            "physics_n": 30,
            "n": 100,
        }
        for length in (2, 4, 6, 8, 10)
    }


def spread() -> dict[str, Any]:
    """Shares per draw as ``make study`` writes them."""
    shares = {"shortest": [0.9, 0.92, 0.94], "feasible": [0.1, 0.08, 0.06]}
    subsets = {"all": shares, "unseen": shares}
    searches = {"default": subsets, "adaptation": subsets, "best_first": subsets}
    return {"paper": searches, "improved": searches, "relational": {"adaptation": subsets}}


def cases() -> dict[str, Any]:
    """Figures as ``make cases`` writes them."""
    cell = {"scenes": 20, "trainings": 1, "problems": 20, "solved": 10, "solved_min": 10}
    cell |= {"solved_within_2k": 4}
    means = {"calls_mean": 18.5, "infeasible_calls_mean": 7.0, "failed_candidates_mean": 0.5}
    means |= {"calls_limited_mean": 60.0}
    learnt = {"trainings": 3, "problems": 60, "solved": 60, "solved_min": 20, "calls_mean": 6.5}
    without = (
        cell | means | {"plan_length_mean": 5.0, "path_verified_share": None, "physics_share": None}
    )
    ours = without | learnt | {"path_verified_share": 1.0, "physics_share": 0.95}
    planners = {"no_policy": without, "facts": without, "relational": ours}
    return {"rows": dict.fromkeys(("4", "5"), planners)}


def cases_compared() -> dict[str, Any]:
    """The policy against the best rival: half its calls and less, or not."""
    ratio = {"rival": "facts", "calls": 6.5, "rival_calls": 18.5, "low": 0.3, "high": 0.4}
    given = ratio | {"rival": "facts_tuned", "rival_calls": 7.0, "ratio": 0.93}
    sizes = {"with_facts": ratio | {"ratio": 0.35}, "facts_given": given}
    return {"rows": {"4": sizes, "5": sizes}}


def _verdicts(scene: Scene, rng: np.random.Generator) -> list[dict[str, Any]]:
    rows, open_ = [], [((), scene.state)]
    for _ in range(3):
        deeper = []
        for prefix, state in open_:
            for action in applicable_actions(state, scene.symbols):
                skeleton = (*prefix, action)
                feasible = bool(rng.random() < 0.8)
                constraint = rng.choice(["hold", "clear l_forearm_link tab2", "placement"])
                rows.append(
                    {
                        "configuration": scene.name,
                        "skeleton": format_skeleton(skeleton),
                        "length": len(skeleton),
                        "feasible": feasible,
                        "failure_action": None if feasible else len(skeleton) - 1,
                        "failure_constraint": None if feasible else str(constraint),
                    }
                )
                if feasible:
                    deeper.append((skeleton, successor(state, action)))
        open_ = deeper
    return rows


def _write_generalization(root: Path, scenes: Any, rng: np.random.Generator) -> None:
    shares = {"default": (0.9, 0.09, 0.01), "adaptation": (0.95, 0.045, 0.005)}
    shares["best_first"] = (0.99, 0.01, 0.0)
    shares |= {f"improved_{name}": share for name, share in shares.items()}
    shares |= {"relational": (0.995, 0.005, 0.0), "relational_best_first": (1.0, 0.0, 0.0)}
    shares["uniform_best_first"] = (0.8, 0.15, 0.05)
    symbols = scenes[0].symbols
    objectives = one_goal_objectives(symbols) + two_goal_objectives(symbols)
    rows = [
        {
            "configuration": scene.name,
            "objective": format_objective(objective),
            "unseen": len(objective) == 1,
            "planner": planner,
            "outcome": str(rng.choice(["shortest", "feasible", "no_solution"], p=p)),
            "length": 4,
            "policy_calls": 6,
            "coarse_calls": 5,
            "infeasible_calls": 1,
            "failed_candidates": 0,
        }
        for scene in scenes
        for objective in objectives
        for planner, p in shares.items()
    ]
    write_table(root / EVALUATION / "generalization.parquet", pa.Table.from_pylist(rows))
    metrics = {
        planner: {
            subset: {
                "n": n,
                "trivial": 0.03,
                "shortest": p[0],
                "feasible": p[1],
                "no_solution": p[2],
                "reattempt_infeasible": 0.02,
                "reattempt_max_depth": 0.01,
                "unsolvable": 0.0,
                "shortest_without_path": 0.004,
            }
            for subset, n in (("all", 170), ("unseen", 90))
        }
        for planner, p in shares.items()
    }
    write_json(root / METRICS / "generalization.json", metrics)


def _write_scalability(root: Path, scenes: Any) -> None:
    rows, metrics, timing = [], {}, {}
    for index, problem in enumerate(PROBLEMS):
        kept = scenes[problem.setup]
        objectives = problem.objectives(kept[0].symbols.boxes)
        cells, times = metrics.setdefault(problem.name, {}), timing.setdefault(problem.name, {})
        for planner, sizes in TREE.items():
            size = sizes[index]
            rows += [
                {
                    "problem": problem.name,
                    "configuration": scene.name,
                    "objective": format_objective(objective),
                    "planner": planner,
                    "solved": size is not None,
                    "reason": "max_tree_size" if size is None else None,
                    "skeleton": "(grasp pr2L red) (place pr2L red tab1)" if size else None,
                }
                for scene in kept
                for objective in objectives
            ]
            n = len(kept) * len(objectives)
            # A planner that was stopped solved one problem, whose figures must not be shown.
            cells[planner] = {
                "objectives": len(objectives),
                "solved": len(objectives) if size else 0,
                "problems": n,
                "problems_solved": n if size else 1,
                "tree_size_mean": size or 12345.0,
                "tree_size_std": 0.1 * (size or 12345.0),
                "plan_length_mean": float(problem.k_min),
                **{f"{part}_calls_mean": 1.1 * problem.k_min for part in ("policy", "coarse")},
                "infeasible_calls_mean": 2.5,
                "failed_candidates_mean": 0.5,
                "path_calls_mean": 1.0,
            }
            total = 0.5 + 1e-3 * (size or 12345.0)
            parts = ("time_mean_s", "time_std_s", "symbolic_s", "policy_s", "coarse_s", "path_s")
            times[planner] = {
                key: share * total
                for key, share in zip(parts, (1, 0.1, 0.4, 0.01, 0.2, 0.39), strict=True)
            } | {"peak_rss_mb": 640.0}
    write_table(root / EVALUATION / "scalability.parquet", pa.Table.from_pylist(rows))
    write_json(root / METRICS / "scalability.json", metrics)
    write_json(root / METRICS / "scalability_timing.json", timing)


def _training(classes: tuple[str, ...], rng: np.random.Generator) -> dict[str, Any]:
    epochs = np.arange(1, 61)
    curves = {
        "training_loss": (0.3 + epochs**-0.3).tolist(),
        "training_accuracy": (1 - 0.5 * epochs**-0.3).tolist(),
        "validation_loss": (0.28 + 0.95 * epochs**-0.3).tolist(),
        "validation_accuracy": (1 - 0.45 * epochs**-0.3).tolist(),
    }
    figures = {
        "accuracy": curves["validation_accuracy"][-1],
        "loss": curves["validation_loss"][-1],
        "epochs": 60,
        "best_epoch": 60,
        "confusion": rng.integers(0, 500, (len(classes), len(classes))).tolist(),
        "curves": curves,
    }
    return {"classes": classes, **figures, "by_configuration": figures}


class Bounds:
    """Stands for the bounds of a scene: a fixed motion for every sequence."""

    def __init__(self, scene: Scene, params: object) -> None:
        self._box = scene.boxes[0].name

    def path(self, skeleton: Skeleton) -> PathResult:
        return PathResult(skeleton, True, motion(self._box))


def motion(box: str) -> Trajectory:
    """The left arm swings to the front for two seconds and carries a box meanwhile."""
    times = np.linspace(0.0, 2.0, 41)
    q = np.tile(load_robot("pr2").home, (len(times), 1))
    q[:, 0] -= 0.8 * np.sin(np.pi * times / 4)
    return Trajectory(load_robot("pr2").joint_names, times, q, (Attachment(box, "pr2L", 10, 30),))


def with_fingers(motion: Trajectory) -> Trajectory:
    """The motion with joints of fingers, which stand still."""
    joints = load_robot("pr2").moving_joints
    more = np.zeros((len(motion.times), len(joints) - len(motion.joint_names)))
    return replace(motion, joint_names=joints, q=np.hstack([motion.q, more]))
