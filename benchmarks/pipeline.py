"""Benchmark of the pipeline: rivals of guided search, enumeration, training, memory, whole runs.

The planners need the scenes and models of a pipeline run, the rest nothing:
python benchmarks/pipeline.py
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import yaml

from guided_lgp import parallel
from guided_lgp.experiments import compare_scalability, enumerate_sequences
from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.params import load_params
from guided_lgp.paths import PARAMS, SCENES, TRAINED
from guided_lgp.policy.paper.training import fit
from guided_lgp.scene import generate, load_scenes

ROOT = Path(__file__).parents[1]
SEED = 20_002
"""Of scenes and samples; no stage of the pipeline uses it."""
CONFIGURATIONS = 8
LONGEST = 12
"""Least number of actions of the longest problems, those of six boxes. With eight and ten, a single
configuration takes over twenty core minutes, most of it spent by planners that fail; Table III has
them."""
SAMPLES, INPUTS, EPOCHS = 90_000, 41, 5


def planners() -> dict[str, Any]:
    """Every planner of Table III on the first configuration of a problem: means over solved."""
    params = load_params(ROOT / PARAMS)
    problems = [problem for problem in PROBLEMS if problem.k_min <= LONGEST]
    tasks = [
        compare_scalability.Task(
            problem.name,
            load_scenes(ROOT / SCENES / f"scalability_{problem.setup}.json").scenes[0],
            params.bounds,
            params.compare_scalability,
            ROOT / TRAINED,
        )
        for problem in reversed(problems)  # the longest first
    ]
    parts = parallel.run(compare_scalability.compare, tasks, params.parallel, "planners")
    rows = [row for part in reversed(parts) for row in part]
    sizes = compare_scalability.summarize(rows)
    times = compare_scalability.summarize_times(rows)
    return {
        problem.name: {
            planner: cell | times[problem.name][planner]
            for planner, cell in sizes[problem.name].items()
        }
        for problem in problems
    }


def enumeration() -> dict[str, float]:
    """Verified verdicts per second by number of workers, their start included."""
    params = load_params(ROOT / PARAMS)
    scenes = generate("a", CONFIGURATIONS, SEED, "bench").scenes
    speeds = {}
    for workers in range(1, (os.cpu_count() or 1) + 1):
        with tempfile.TemporaryDirectory() as folder:
            tasks = [
                enumerate_sequences.Task(
                    scene, params.bounds, params.enumerate_sequences, "", Path(folder)
                )
                for scene in scenes
            ]
            settings = params.parallel.model_copy(update={"workers": workers})
            began = time.perf_counter()
            parallel.run(
                enumerate_sequences.write_shard, tasks, settings, f"enumeration, {workers} workers"
            )
            elapsed = time.perf_counter() - began
            verdicts = sum(
                pq.read_metadata(task.shard / "verdicts.parquet").num_rows for task in tasks
            )
        speeds[str(workers)] = verdicts / elapsed
    return speeds


def training() -> dict[str, float]:
    """Training samples per second of each network of Table IV: one sub-policy on one core."""
    params = load_params(ROOT / PARAMS)
    rng = np.random.default_rng(SEED)
    inputs = rng.standard_normal((SAMPLES, INPUTS)).astype(np.float32)
    classes = rng.integers(0, 3, SAMPLES)
    speeds = {}
    for network in ("instruction", "grasp", "place"):
        settings = getattr(params.train_policy, network).model_copy(update={"epochs": EPOCHS})
        began = time.perf_counter()
        fit(
            (inputs, classes),
            (inputs[:1000], classes[:1000]),
            3,
            settings,
            EPOCHS,
            np.random.SeedSequence(SEED),
        )
        speeds[network] = SAMPLES * EPOCHS / (time.perf_counter() - began)
    return speeds


def memory() -> dict[str, float]:
    """Peak resident memory (MB) of the largest process of each stage, in the small profile."""
    stages = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["stages"]
    peaks: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        copy(ROOT / "tests" / PARAMS, Path(folder) / PARAMS)
        uri = f"sqlite:///{folder}/mlflow.db"
        for stage, entry in stages.items():
            script = str(ROOT / "stages" / f"{stage}.py")
            for network in entry.get("matrix", {}).get("network", [None]):
                words = [script, network] if network else [script]
                done = subprocess.run(
                    [sys.executable, "-c", _PEAK, sys.executable, *words],
                    cwd=folder,
                    env=os.environ | {"MLFLOW_TRACKING_URI": uri},
                    stdout=subprocess.PIPE,
                    check=True,
                )
                peaks[stage] = max(peaks.get(stage, 0.0), int(done.stdout) / 1024)
    return peaks


def minutes() -> dict[str, Any]:
    """Wall time of ``make repro`` and ``make test`` in a fresh clone, after installation.

    Also which committed files ``make repro`` has written otherwise: times, and nothing else.
    """
    test = ["pytest", "-q", "-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder"]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["git", "clone", "-q", str(ROOT), folder], check=True)
        repro = _minutes_of(folder, ["dvc", "repro", "-q"])
        git = ["git", "-C", folder, "diff", "--name-only"]
        changed = subprocess.run(git, stdout=subprocess.PIPE, text=True, check=True).stdout.split()
        figures = {"repro": repro, "changed": changed, "test": _minutes_of(folder, test)}
    return figures | {"load_before": _LOAD}


def _minutes_of(folder: str, command: list[str]) -> float:
    """Wall time of a command on the sources of a clone."""
    here = {"PYTHONPATH": f"{folder}/src", "MLFLOW_TRACKING_URI": f"sqlite:///{folder}/mlflow.db"}
    began = time.perf_counter()
    subprocess.run(command, cwd=folder, env=os.environ | here, stdout=sys.stderr, check=True)
    return (time.perf_counter() - began) / 60


_LOAD = os.getloadavg()[0]
"""Processes that ran or waited when this program began: times are those of a quiet machine at 0."""

_PEAK = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=sys.stderr, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
"""Between this process and a stage, since a new process takes over the peak of what starts it."""


if __name__ == "__main__":
    parts = {"planners": planners, "enumeration": enumeration}
    parts |= {"training": training, "memory": memory, "minutes": minutes}
    chosen = sys.argv[1:] or list(parts)
    json.dump({name: parts[name]() for name in chosen}, sys.stdout, indent=1)
    sys.stdout.write("\n")
