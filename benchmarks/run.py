"""All benchmarks, as ``make bench`` runs them.

Writes ``geometry.json`` and ``benchmark.json`` to ``reports/metrics``, after every part, and
``docs/benchmarks.md`` from the latter:

    python benchmarks/run.py [--count N] [PART ...]

With parts named, the figures of the others stay. Those of ``peers`` always stay until it is named:
that part needs an environment of its own, which ``make bench-peers`` installs before it measures.
"""

import argparse
import logging
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import against
import coarse
import limits
import path
import peers
import pipeline
import witness
from guided_lgp.documents import read_json, write_json
from guided_lgp.paths import METRICS
from guided_lgp.report.benchmarks import PAGE, benchmark_page

ROOT = Path(__file__).parents[1]
PACKAGES = ("casadi", "pybullet", "pin", "coal", "numpy", "torch")
logger = logging.getLogger("benchmarks")


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.split(": ")[1] for line in lines if line.startswith("model name")]
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return {
        "cpu": names[0] if names else platform.machine(),
        "cores": os.cpu_count(),
        "memory_gb": round(memory, 1),
        "system": platform.system(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
    }


MEASURES: dict[str, Callable[[int], Any]] = {
    "coarse_bound": coarse.measure,
    "path_bound": path.measure,
    "enumeration": lambda count: pipeline.enumeration(),
    "planners": lambda count: pipeline.planners(),
    "training": lambda count: pipeline.training(),
    "memory": lambda count: pipeline.memory(),
    "against": against.measure,
    "limits": lambda count: limits.measure(),
    "false_infeasible": lambda count: witness.measure(),
    "minutes": lambda count: pipeline.minutes(),
}
"""By part, what measures it, given the number of sequences per length."""
APART: dict[str, Callable[[int], Any]] = {"peers": lambda count: peers.measure()}
"""Parts that are measured only when they are named."""


def kept(target: Path, parts: list[str]) -> dict[str, Any]:
    """What stays of an earlier run: all of it if parts are named, else what is measured apart."""
    if not parts and not target.is_file():
        return {}
    before: dict[str, Any] = read_json(target, "an earlier run of all parts")
    if parts:
        return before
    apart = {name: before[name] for name in APART if name in before}
    return apart | {"measured_on": {name: before["measured_on"][name] for name in apart}}


def main(parts: list[str], count: int) -> None:
    target = ROOT / METRICS / "benchmark.json"
    figures = kept(target, parts)
    figures["machine"] = machine()
    for name in parts or MEASURES:
        logger.info(name)
        figures[name] = (MEASURES | APART)[name](count)
        figures.setdefault("measured_on", {})[name] = figures["machine"]["cpu"]
        if name == "against":
            figures["speedup"] = against.ratios(figures[name])
        write_json(target, figures)
    geometry: dict[str, dict[str, Any]] = {}
    for bound in ("coarse_bound", "path_bound"):
        for length, row in figures.get(bound, {}).items():
            plain = {key: value for key, value in row.items() if key != "ipopt"}
            geometry[length] = geometry.get(length, {}) | plain
    write_json(ROOT / METRICS / "geometry.json", geometry)
    (ROOT / PAGE).write_text(benchmark_page(figures), encoding="utf-8")
    logger.info("written: geometry.json, benchmark.json in %s, and %s", METRICS, PAGE)


if __name__ == "__main__":
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help="those to measure, by default all but peers")
    parser.add_argument("--count", type=int, default=100, help="sequences per length")
    arguments = parser.parse_args()
    known = MEASURES | APART
    if unknown := set(arguments.parts) - set(known):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    main(arguments.parts, arguments.count)
