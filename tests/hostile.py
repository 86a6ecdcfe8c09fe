"""Hostile hands and two at once: the check of `make verify-hostile`.

Spoils the input of every reader and command, kills writers and stages inside the windows in which
they write, races processes, plants files, fills the disk, takes memory away and changes the
environment. Writes `reports/metrics/hostile.json`; ends with 1 if anything came through.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from dataclasses import asdict
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from guided_lgp import cache
from guided_lgp.documents import write_json
from guided_lgp.experiments import (
    build_dataset,
    enumerate_sequences,
    generate_scenes,
    train_relational,
)
from guided_lgp.params import load_params
from hostility import environments, kills, limits, planted, races
from hostility.commands import Commands
from hostility.judge import Verdicts, judge
from hostility.kills import contents, kill_a_stage
from hostility.loaders import ROOT, Examples, loaders
from hostility.writers import PARAMS, writers

SEED = 20
INPUTS, COMMANDS = 27_500, 3_000
RESULT = ROOT / "reports" / "metrics" / "hostile.json"
STAGES = {
    generate_scenes: (0, 5, 10, 15, 20, 25, 30, 35),
    enumerate_sequences: (1, 3, 5, 7, 9, 11, 13, 15),
    build_dataset: (0, 3, 6, 9, 12, 15),
    train_relational: (1, 4, 7, 10),
}
"""Stages of the small profile, and the moments at which they are killed."""


def inputs(folder: Path, seed: int, count: int, commands: int) -> tuple[Verdicts, dict[str, Any]]:
    """Judge so many spoilt files and commands: all verdicts, and the figures of each reader."""
    readers = loaders(folder)
    shares = sum(reader.share for reader in readers)
    work = [
        (reader.name, partial(reader.attempt, seed), round(count * reader.share / shares))
        for reader in readers
    ]
    command = Commands(Examples(folder / "commands"))
    work.append((command.name, partial(command.attempt, seed), commands))
    every, figures = Verdicts(), {}
    for name, attempt, number in work:
        start = time.monotonic()
        found = judge(attempt, range(number))
        every.counts += found.counts
        every.faults += [f"{name} {fault}" for fault in found.faults]
        figures[name] = found.figures()
        print(f"{name}: {figures[name]}, {time.monotonic() - start:.0f} s", flush=True)
    return every, figures


def killed(folder: Path) -> kills.Figures:
    """Kill every writer at every moment, and stages of the small profile at some."""
    figures = kills.Figures()
    for writer in writers(Examples(folder / "examples")):
        before = figures.inside_window
        writer.kill_everywhere(folder / writer.name.replace(" ", "-"), figures)
        print(f"{writer.name}: {figures.inside_window - before} kills", flush=True)
    params = load_params(PARAMS)
    params = params.model_copy(
        update={"parallel": params.parallel.model_copy(update={"workers": 1})}
    )
    roots = [folder / "undisturbed", folder / "killed"]
    for root in roots:
        root.mkdir(parents=True)
        shutil.copy(ROOT / "dvc.yaml", root)
        (root / "src").symlink_to(ROOT / "src")
    for stage, moments in STAGES.items():
        stage.run(params, roots[0])
        before = figures.in_stages
        kill_a_stage(lambda root, stage=stage: stage.run(params, root), roots[1], moments, figures)
        print(f"{stage.__name__}: {figures.in_stages - before} kills", flush=True)
    expected, found = map(contents, roots)
    for name in expected.keys() | found.keys():
        if expected.get(name) != found.get(name) and ".shards" not in name:
            figures.damage(f"{name} is another after kills")
    return figures


_PLAN = """
import time
from guided_lgp import cache

spent = []

def timed(function):
    def call(*arguments):
        start = time.process_time()
        result = function(*arguments)
        spent.append(time.process_time() - start)
        return result
    return call

cache.kept, cache.made = timed(cache.kept), timed(cache.made)
from guided_lgp import planning

assert planning.plan("examples/three_boxes.json", "(on red green)").solved
assert len(spent) > 1
print(1000 * sum(spent))
"""


def startup_ms() -> float:
    """CPU time (ms) that a plan spends on the checks of the cache, the median of five."""
    command = [sys.executable, "-c", _PLAN]
    runs = [subprocess.run(command, cwd=ROOT, capture_output=True, check=True) for _ in range(6)]
    return statistics.median(float(run.stdout) for run in runs[1:])  # the first may fill the cache


def verify(folder: Path, seed: int, count: int, commands: int) -> tuple[dict[str, Any], list[str]]:
    """Everything: the figures, and what came through."""
    faults: list[str] = []
    tried, by_reader = inputs(folder / "inputs", seed, count, commands)
    faults += tried.faults
    kill = killed(folder / "kills")
    race, disk, place = races.Figures(), limits.Figures(), environments.Figures()
    races.all_races(folder / "races", race)
    (folder / "planted").mkdir()
    plants = planted.all_plants(folder / "planted")
    small = writers(Examples(folder / "small"))
    limits.write_on_full_disks(small, folder / "disks", disk)
    limits.plan_with_little_memory(folder / "memory", disk)
    environments.all_environments(folder / "environments", cache.cache_folder(), place)
    for part in (kill, race, disk, place):
        faults += part.faults
    faults += [f"planted: {name}" for name, effective in plants.items() if effective]
    figures = {
        "seed": seed,
        "inputs": {**tried.figures(), "by_reader": by_reader},
        "kills": _without_faults(kill),
        "races": _without_faults(race),
        "planted": {"tried": len(plants), "effective": sum(plants.values())},
        "limits": _without_faults(disk),
        "environments": _without_faults(place),
        "startup_ms": round(startup_ms(), 2),
    }
    return figures, faults


def _without_faults(figures: Any) -> dict[str, int]:
    return {name: value for name, value in asdict(figures).items() if name != "faults"}


def main() -> int:
    """Run, write, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=INPUTS)
    parser.add_argument("--commands", type=int, default=COMMANDS)
    parser.add_argument("--out", type=Path, default=RESULT)
    words = parser.parse_args()
    start = time.monotonic()
    with TemporaryDirectory(prefix="hostile-") as folder:
        figures, faults = verify(Path(folder), SEED, words.inputs, words.commands)
    write_json(words.out, figures)
    for fault in faults:
        print(fault)
    shown = {name: value for name, value in figures.items() if name != "inputs"}
    print(json.dumps(figures["inputs"] | {"by_reader": None}), json.dumps(shown))
    print(f"{time.monotonic() - start:.0f} s, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
