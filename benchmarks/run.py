"""All benchmarks, as ``make bench`` runs them: writes their figures to ``reports/metrics``.

python benchmarks/run.py [sequences per length of the geometry, 100 by default]
"""

import logging
import sys
from pathlib import Path

import coarse
import path
import search
from guided_lgp.documents import write_json
from guided_lgp.paths import METRICS

ROOT = Path(__file__).parents[1]
logger = logging.getLogger("benchmarks")


def main(count: int) -> None:
    logger.info("coarse bound: %d sequences per length", count)
    keyframes = coarse.measure(count)
    against = {length: figures.pop("ipopt") for length, figures in keyframes.items()}
    logger.info("path bound: %d sequences per length", count)
    motions = path.measure(count)
    geometry = {length: {**figures, **motions[length]} for length, figures in keyframes.items()}
    write_json(ROOT / METRICS / "geometry.json", geometry)
    logger.info("planners")
    figures = {"coarse_against_ipopt": against, **search.measure(ROOT)}
    write_json(ROOT / METRICS / "benchmark.json", figures)
    logger.info("written: geometry.json, benchmark.json in %s", METRICS)


if __name__ == "__main__":
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
