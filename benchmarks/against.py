"""Benchmark of this version against an older one, both run here and now, in turns.

The older one is checked out beside the repository for the time of the run; no stored time enters
a ratio. All ratios are its CPU time divided by this version's: python benchmarks/against.py [PART]
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from guided_lgp.logic.objectives import satisfied, two_goal_objectives
from guided_lgp.scene import generate

ROOT = Path(__file__).parents[1]
BASELINE = "50577ca"
"""Version 0.1.0, which all later ones are measured against."""
VERSIONS = ("old", "new")
LENGTHS = tuple(range(2, 11))
SEED = 20_004
SCENES = 20
"""Configurations per setup, as in ``version.py``."""
COUNT = 100
"""Random sequences: half of them get verdicts, in setup e.10, a tenth get paths, in setup a. The
enumeration runs in a tenth as many configurations."""
LONG, STEPS, ATTEMPTS = 40, 100, 200
"""Actions of the long program, steps of the solver on it, and actions tried on the way."""
NODES = 400_000
"""Of the logic tree: the limit of the paper's tables."""
RUNS = 4
"""Of the command per scene; the first one fills caches and is not counted."""
_NO_BYTECODE = "PYTHONDONTWRITEBYTECODE"
TOWER = ("purple", "yellow", "blue", "green", "red", "tray")
COMMANDS = {
    "3": ("three_boxes.json", ("(on red green)", "(held blue)")),
    "10": (
        "ten_boxes.json",
        tuple(f"(on {upper} {lower})" for upper, lower in pairwise(TOWER)),
    ),
}
"""By number of actions: what the command plans."""


class Version:
    """A process that runs on the sources of one version."""

    def __init__(self, sources: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(ROOT / "benchmarks" / "version.py")],
            env=environment(sources),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, *request: Any) -> Any:
        """The answer to one request."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(request), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def environment(sources: Path) -> dict[str, str]:
    """Variables of a process on some sources; one thread, as the ratios are of CPU time.

    Python keeps the bytecode of all modules, as it does where a user installs them.
    """
    kept = {name: value for name, value in os.environ.items() if name != _NO_BYTECODE}
    return kept | {"PYTHONPATH": str(sources), "OMP_NUM_THREADS": "1"}


@dataclass
class Pair:
    """Both versions, asked in turns; who is first changes with every request."""

    old: Version
    new: Version
    asked: int = field(default=0)

    def ask(self, *request: Any) -> dict[str, Any]:
        """Both answers, by version."""
        self.asked += 1
        order = VERSIONS if self.asked % 2 else VERSIONS[::-1]
        answers = {name: getattr(self, name).ask(*request) for name in order}
        return {name: answers[name] for name in VERSIONS}


@contextmanager
def baseline() -> Iterator[Path]:
    """The sources of the older version, in a worktree that is there for as long as it is needed."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "baseline"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "-q", "--detach", str(tree), BASELINE], check=True)
        try:
            yield tree / "src"
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)


@contextmanager
def both() -> Iterator[Pair]:
    """Processes of both versions."""
    with baseline() as sources:
        pair = Pair(Version(sources), Version(ROOT / "src"))
        try:
            yield pair
        finally:
            pair.old.close()
            pair.new.close()


def measure(count: int = COUNT) -> dict[str, Any]:
    """Every ratio, and the times and numbers behind it."""
    with both() as pair:
        figures = {name: part(pair, count) for name, part in PARTS.items()}
    return {"baseline": BASELINE} | figures | processes() | {"load": round(os.getloadavg()[2], 1)}


def coarse_bound(pair: Pair, count: int) -> dict[str, Any]:
    """Verdicts of the coarse bound whose prefix is feasible.

    Those that the enumeration of setup a asks for, and in the setup of the largest searches those
    along random walks that end at the first infeasible one. What no fact explains is so rare there
    that it is looked for elsewhere, too; both versions give it the same number of starts.
    """
    verdicts = [*_enumerated(pair, max(1, count // 10)), *_walks(pair, "e10", max(1, count // 2))]
    same = {feasible: [v for v in verdicts if _both(v, feasible)] for feasible in (True, False)}
    others = [v for v in _crowds(pair, "e6", max(1, count // 5)) if _both(v, False)]
    unexplained = [v for v in (*same[False], *others) if _starts(v, "old") == _starts(v, "new") > 0]
    return {
        "feasible": summary(same[True]),
        "infeasible": summary(same[False]),
        "infeasible_without_fact": summary(unexplained),
        "changed_to_feasible": sum(_only(v, "new") for v in verdicts),
        "changed_to_infeasible": sum(_only(v, "old") for v in verdicts),
        "refused_now": Counter(filter(None, (v["refused_for"] for v in verdicts))),
    }


def _enumerated(pair: Pair, scenes: int) -> Iterator[dict[str, Any]]:
    """Verdicts of both versions on what the enumeration asks for, by version."""
    for number in range(scenes):
        feasible: set[tuple[str, ...]] = {()}
        for words in pair.new.ask("enumerated", "a", number):
            if tuple(words[:-1]) in feasible:
                verdict = _verdict(pair, "a", number, words)
                feasible |= {tuple(words)} if _both(verdict, True) else set()
                yield verdict


def _verdict(pair: Pair, setup: str, number: int, words: list[str]) -> dict[str, Any]:
    """Of both versions, and for what today's verification refuses what only the older one finds.

    Joints have soft limits now, for one, which the older version does not know.
    """
    verdict = pair.ask("coarse", setup, number, words)
    verdict["refused_for"] = None
    if _only(verdict, "old"):
        found = pair.old.ask("keyframes", setup, number, words)
        verdict["refused_for"] = pair.new.ask("refusal", setup, number, words, *found)
    return verdict


def _walks(pair: Pair, setup: str, count: int) -> Iterator[dict[str, Any]]:
    """Verdicts of both versions along random sequences, by version."""
    rng = np.random.default_rng([SEED, count])
    for walk in range(count):
        number = walk * SCENES // count
        words: list[str] = []
        while len(words) < max(LENGTHS):
            words.append(_random(pair, setup, number, words, rng))
            verdict = _verdict(pair, setup, number, words)
            yield verdict
            if not _both(verdict, True):
                break


def _crowds(pair: Pair, setup: str, count: int) -> Iterator[dict[str, Any]]:
    """Verdicts of both versions on putting box after box on one until that fails, by version.

    Facts are about arms and about what stands where it was at the start: not about this.
    """
    rng = np.random.default_rng([SEED, 4])
    for number, scene in enumerate(generate(setup, SCENES, SEED, "bench").scenes[:count]):
        base, *others = (box.name for box in scene.boxes)
        words: list[str] = []
        for box in others:
            hand = rng.choice(scene.symbols.grippers)
            grasp, place = f"(grasp {hand} {box})", f"(place {hand} {box} {base})"
            if _both(pair.ask("coarse", setup, number, [*words, grasp]), True):
                verdict = _verdict(pair, setup, number, words := [*words, grasp, place])
                yield verdict
                if not _both(verdict, True):
                    break


def _starts(verdict: dict[str, Any], version: str) -> int:
    return int(verdict[version]["starts"])


def _random(pair: Pair, setup: str, number: int, words: list[str], rng: np.random.Generator) -> str:
    choices = pair.new.ask("choices", setup, number, words)
    return str(choices[rng.integers(len(choices))])


def _both(verdict: dict[str, Any], feasible: bool) -> bool:
    return all(verdict[name]["feasible"] is feasible for name in VERSIONS)


def path_bound(pair: Pair, count: int) -> dict[str, Any]:
    """Path bound and its verification on random coarse-feasible sequences of setup a.

    Each is in a scene of its own; all prefixes are planned.
    """
    rng = np.random.default_rng([SEED, 1])
    verdicts: dict[int, list[dict[str, Any]]] = {length: [] for length in LENGTHS}
    for number in range(max(1, count // 10)):
        words = _feasible(pair, "a", number, max(LENGTHS), rng)
        for length in LENGTHS:
            verdicts[length].append(pair.ask("path", "a", number, words[:length]))
    return {
        str(length): summary([v for v in rows if _both(v, True)])
        | {
            "changed_to_feasible": sum(_only(v, "new") for v in rows),
            "changed_to_infeasible": sum(_only(v, "old") for v in rows),
        }
        for length, rows in verdicts.items()
    }


def _only(verdict: dict[str, Any], version: str) -> bool:
    """Whether one version alone says that it is feasible."""
    return bool(verdict[version]["feasible"]) and not _both(verdict, True)


def _feasible(
    pair: Pair, setup: str, number: int, length: int, rng: np.random.Generator
) -> list[str]:
    """A random sequence, feasible for both: what is not is drawn again, or else the whole of it."""
    words: list[str] = []
    for _ in range(ATTEMPTS):
        if len(words) == length:
            return words
        longer = [*words, _random(pair, setup, number, words, rng)]
        if _both(pair.ask("coarse", setup, number, longer), True):
            words = longer
    return _feasible(pair, setup, number, length, rng)


def enumeration(pair: Pair, count: int) -> dict[str, Any]:
    """Verdicts per second of the stage that enumerates setup a."""
    answers = [pair.ask("enumeration", "a", number) for number in range(max(1, count // 20))]
    figures = summary(answers)
    totals = {v: sum(a[v]["seconds"] for a in answers) for v in VERSIONS}
    rates = {v: sum(a[v]["verdicts"] for a in answers) / totals[v] for v in VERSIONS}
    return figures | {
        "old_per_s": rates["old"],
        "new_per_s": rates["new"],
        "ratio": rates["new"] / rates["old"],
    }


def plans(pair: Pair, count: int) -> dict[str, Any]:
    """Whole plans of the default planner: two goals in every configuration of setup a."""
    problems = list(_problems(max(1, count // 50)))
    pair.ask("plan", *problems[0])  # which loads what all others find loaded
    answers = [pair.ask("plan", *problem) for problem in problems]
    both = [answer for answer in answers if _both(answer, True)]
    old, new = (sum(answer[version]["seconds"] for answer in both) for version in VERSIONS)
    solved = {f"{v}_solved": sum(answer[v]["feasible"] for answer in answers) for v in VERSIONS}
    return summary(both) | solved | {"problems": len(answers), "ratio_of_sums": old / new}


def _problems(count: int) -> Iterator[tuple[str, int, list[str]]]:
    """Setup, configuration, and two goals that do not hold there yet; so many of each."""
    rng = np.random.default_rng([SEED, 3])
    for number, scene in enumerate(generate("a", SCENES, SEED, "bench").scenes):
        pairs = two_goal_objectives(scene.symbols)
        open_ones = [pair for pair in pairs if not satisfied(scene.state, pair)]
        for choice in rng.integers(len(open_ones), size=count):
            yield "a", number, [str(goal) for goal in open_ones[choice]]


def coarse_step(pair: Pair, count: int) -> dict[str, Any]:
    """One step of the solver on a program of 40 actions with ten boxes."""
    rng = np.random.default_rng([SEED, 2])
    words = _feasible(pair, "e10", 0, LONG, rng)
    runs = [pair.ask("step", "e10", 0, words, STEPS) for _ in range(RUNS)]
    sizes = {f"{v}_{size}": runs[0][v][size] for v in VERSIONS for size in ("variables", "rows")}
    return summary(runs) | sizes


def logic_tree(pair: Pair, count: int) -> dict[str, Any]:
    """The symbolic search alone: as many nodes as the paper's baseline generates at most."""
    answers = [pair.ask("logic_tree", "b", number % SCENES, NODES) for number in range(RUNS)]
    return summary(answers) | {"nodes": answers[0]["new"]["nodes"]}


def processes() -> dict[str, Any]:
    """The command, warm: a process of its own from start to end.

    As it is, and without what the older version does not do: all arms moving at once.
    """
    with baseline() as sources:
        figures: dict[str, Any] = {"plan_process": {}, "plan_process_uncoordinated": {}}
        for length, (scene, goals) in COMMANDS.items():
            words = [
                str(ROOT / "examples" / scene),
                *(word for goal in goals for word in ("--goal", goal)),
            ]
            for name, options in zip(figures, ([], ["--no-coordinate"]), strict=True):
                runs = [_turn(sources, words, options) for _ in range(RUNS)]
                figures[name][length] = summary(runs[1:])
        return figures


def _turn(sources: Path, words: list[str], options: list[str]) -> dict[str, Any]:
    """One plan of either version; the older one knows no options."""
    old, new = _run(sources, words), _run(ROOT / "src", [*words, *options])
    return {"old": {"seconds": old}, "new": {"seconds": new}}


def _run(sources: Path, words: list[str]) -> float:
    """CPU seconds of one plan."""
    code = "from guided_lgp.cli import main; main()"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-c", code, "plan", *words],
        env=environment(sources),
        stdout=subprocess.DEVNULL,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def summary(answers: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians in ms, and the median of the ratios."""
    seconds = {v: [answer[v]["seconds"] for answer in answers] for v in VERSIONS}
    if not answers:
        return {"n": 0}
    ratios = [old / new for old, new in zip(seconds["old"], seconds["new"], strict=True)]
    return {
        "n": len(answers),
        "old_median_ms": median(seconds["old"]) * 1e3,
        "new_median_ms": median(seconds["new"]) * 1e3,
        "ratio": median(ratios),
    }


PARTS: dict[str, Callable[[Pair, int], Any]] = {
    "coarse_bound": coarse_bound,
    "path_bound": path_bound,
    "enumeration": enumeration,
    "coarse_step": coarse_step,
    "logic_tree": logic_tree,
    "plans": plans,
}


def ratios(figures: dict[str, Any]) -> dict[str, Any]:
    """``speedup``: one number per row, old CPU time divided by new; null where nothing compares."""
    coarse = figures["coarse_bound"]
    return {
        "path_bound": _ratios(figures["path_bound"]),
        "coarse_infeasible": coarse["infeasible"].get("ratio"),
        "coarse_infeasible_without_fact": coarse["infeasible_without_fact"].get("ratio"),
        "coarse_feasible": coarse["feasible"].get("ratio"),
        "enumeration": figures["enumeration"].get("ratio"),
        "plan_process": _ratios(figures["plan_process"]),
        "plan_process_uncoordinated": _ratios(figures["plan_process_uncoordinated"]),
        "coarse_step_k40": figures["coarse_step"].get("ratio"),
        "logic_tree": figures["logic_tree"].get("ratio"),
    }


def _ratios(rows: dict[str, Any]) -> dict[str, float | None]:
    return {length: row.get("ratio") for length, row in rows.items()}


def main(names: list[str]) -> None:
    """Print the figures of some parts."""
    if names == ["plan_process"]:
        print(json.dumps(processes(), indent=1))
        return
    with both() as pair:
        print(json.dumps({name: PARTS[name](pair, COUNT) for name in names or PARTS}, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
