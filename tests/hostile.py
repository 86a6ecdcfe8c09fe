"""Hostile hands and two at once: the check of `make verify-hostile`.

Spoils the input of every reader and command, kills writers and stages inside the windows in which
they write, races processes, plants files, fills the disk, takes memory away and changes the
environment. Writes `reports/metrics/hostile.json`; ends with 1 if anything came through.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from guided_lgp import cache
from guided_lgp.documents import read_json, write_json, write_text
from guided_lgp.experiments import (
    build_dataset,
    enumerate_sequences,
    generate_scenes,
    train_relational,
)
from guided_lgp.params import load_params
from hostility import environments, kills, limits, planted, races
from hostility.commands import Commands
from hostility.examples import ROOT, Examples
from hostility.judge import Verdicts, judge
from hostility.kills import kill_a_stage
from hostility.loaders import loaders
from hostility.writers import PARAMS, writers

SEED = 20
INPUTS, COMMANDS = 28_700, 1_500
RESULT = ROOT / "reports" / "metrics" / "hostile.json"
STAGES = {
    generate_scenes: (0, 5, 10, 15, 20, 25, 30, 35),
    enumerate_sequences: (1, 3, 5, 7, 9, 11, 13, 15),
    build_dataset: (0, 3, 6, 9, 12, 15),
    train_relational: (1, 4, 7, 10),
}
"""Stages of the small profile, and the moments at which they are killed."""
PAGE, BEGIN, END = ROOT / "SECURITY.md", "<!-- make verify-hostile -->", "<!-- end of it -->"
ROWS = {
    "inputs": (
        "{tried:,} spoilt files and commands: {refused:,} refused, {accepted:,} accepted",
        "{foreign} errors in other words, {slow} took more than 5 s",
    ),
    "kills": (
        "{inside_window} kills while files are written, {in_stages} of them of stages",
        "{damaged} damaged or did not go on to the same bytes",
    ),
    "races": ("{runs} processes at once", "{torn} torn reads, {lost} lost results"),
    "planted": ("{tried} planted files and folders", "{effective} were run or changed a file"),
    "limits": (
        "{tried} times a full disk or little memory",
        "{torn} torn files, {foreign} ends in other words",
    ),
    "environments": ("{tried} environments", "{different} with other bytes"),
}
"""What the page says of each part."""

Part = tuple[Any, list[str]]
"""The figures of a part, and what came through."""


def spoilt_inputs(folder: Path) -> Part:
    """Judge the spoilt files and commands."""
    found, by_reader = inputs(folder, SEED, INPUTS, COMMANDS)
    return {**found.figures(), "by_reader": by_reader}, found.faults


def inputs(
    folder: Path, seed: int, count: int, commands: int
) -> tuple[Verdicts, dict[str, dict[str, int]]]:
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


def killed(folder: Path) -> Part:
    """Kill every writer at every moment, and stages of the small profile at some."""
    figures = kills.Figures()
    for writer in writers(Examples(folder / "examples")):
        before = figures.inside_window
        writer.kill_everywhere(folder / writer.name.replace(" ", "-"), figures)
        print(f"{writer.name}: {figures.inside_window - before} kills", flush=True)
    kill_stages(folder, figures)
    return figures.counts(), figures.faults


def kill_stages(folder: Path, figures: kills.Figures) -> None:
    """Run stages of the small profile undisturbed, and with kills: they write the same bytes."""
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
    kills.compare(*roots, figures)


def raced(folder: Path) -> Part:
    """Processes at once."""
    figures = races.Figures()
    races.all_races(folder, figures)
    return figures.counts(), figures.faults


def plants(folder: Path) -> Part:
    """What somebody else left."""
    folder.mkdir()
    found = planted.all_plants(folder)
    faults = [name for name, effective in found.items() if effective]
    return {"tried": len(found), "effective": len(faults)}, faults


def limited(folder: Path) -> Part:
    """Full disks and little memory."""
    figures = limits.Figures()
    limits.write_on_full_disks(writers(Examples(folder / "examples")), folder / "disks", figures)
    limits.plan_with_little_memory(folder / "memory", figures)
    return figures.counts(), figures.faults


def elsewhere(folder: Path) -> Part:
    """Other environments."""
    figures = environments.Figures()
    environments.all_environments(folder, cache.cache_folder(), figures)
    return figures.counts(), figures.faults


def checks_at_the_start(folder: Path) -> Part:
    """What the checks of the cache cost a plan (ms)."""
    return round(startup_ms(), 2), []


PARTS: dict[str, Callable[[Path], Part]] = {
    "inputs": spoilt_inputs,
    "kills": killed,
    "races": raced,
    "planted": plants,
    "limits": limited,
    "environments": elsewhere,
    "startup_ms": checks_at_the_start,
}
"""By their names in the file."""


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


def main() -> int:
    """Run, write, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; or all")
    chosen = parser.parse_args().parts or list(PARTS)
    faults: list[str] = []
    for name in chosen:
        start = time.monotonic()
        with TemporaryDirectory(prefix="hostile-") as folder:
            figures, found = PARTS[name](Path(folder) / name)
        known = read_json(RESULT) if RESULT.is_file() else {}
        parts = {part: known[part] for part in PARTS if part in known}
        write_json(RESULT, {"seed": SEED, **parts, name: figures})
        faults += [f"{name}: {fault}" for fault in found]
        print(f"{name}: {len(found)} faults, {time.monotonic() - start:.0f} s", flush=True)
    write_page(read_json(RESULT))
    for fault in faults:
        print(fault)
    return 1 if faults else 0


def write_page(figures: Mapping[str, Any]) -> None:
    """Put the figures between the two markers of the page."""
    before, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    write_text(PAGE, f"{before}{begin}\n\n{table(figures)}\n{end}{after}")


def table(figures: Mapping[str, Any]) -> str:
    """What was tried and what came through, a row for each part that has run."""
    rows = [
        f"| {tried.format(**figures[part])} | {effect.format(**figures[part])} |"
        for part, (tried, effect) in ROWS.items()
        if part in figures
    ]
    return "\n".join(["| tried | came through |", "|---|---|", *rows, ""])


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
