"""The command line with words that are wrong."""

import io
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager, nullcontext, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import Mock, patch

import numpy as np

from guided_lgp import cli, tracking
from guided_lgp.errors import LONGEST, InputError
from hostility.examples import ROOT, Examples
from hostility.spoiling import NAMES, ODD, Rng, pick

_PLAN = ("plan", "three_boxes.json", "--goal", "(on red green)")
COMMANDS: tuple[tuple[str, ...], ...] = (
    (*_PLAN, "--planner", "guided", "--policy", "relational", "--max-nodes", "50"),
    (*_PLAN, "--goal", "(held blue)", "--out", "new.json", "--json"),
    (*_PLAN, "--params", "planning.yaml", "--html", "new.html", "--models", "models"),
    (*_PLAN, "--domain", "pick_and_place", "--skeleton", "(grasp pr2L red)", "--candidates", "2"),
    ("pddl", "three_boxes.json", "--goal", "(on red green)", "--folder", "new"),
    ("export", "plan.json", "new.csv", "--speed", "0.5"),
    ("export", "plan.json", "new.json"),
    ("view", "plan.json", "--port", "8081"),
    ("view", "three_boxes.json"),
    ("view", "plan.json", "--rerun", "new.rrd"),
    *((stage, "--case", "rows") for stage in ("demonstrate", "replay_case")),
    ("train_case", "--case", "rows", "--seed", "1", "--timeout", "60"),
    ("evaluate_case", "--case", "rows", "--training", "rivals"),
    ("replan", "plan.json", "--observed", "state.json", "--after", "1", "--out", "rest.json"),
    ("execute", "plan.json", "--grip", "friction", "--friction", "0.6", "--force", "20"),
    ("execute", "plan.json", "--noise", "0.008", "--seed", "1", "--closed-loop", "--json"),
    ("schema", "scene"),
    ("examples", "new"),
    ("mlflow", "ui", "--port", "5001"),
    *((stage, "--params", "params.yaml", "--timeout", "60") for stage in cli.STAGES),
    *((f"train_{kind}", "place", "--params", "params.yaml") for kind in ("policy", "improved")),
)
_CASES = ("collect", "demonstrate", "evaluate", "replay", "train")
"""The modules of their stages."""
_END = {"plan": ("--timeout", "0.2")}
"""Added to a command whatever its words are: good input may take as long as it likes."""
_WORDS = ("--goal", "--json", "--help", "-h", "--", "-", "--out", "--timeout", "plan")


@dataclass(frozen=True)
class Commands:
    """Runs commands in a deep folder of their own, with what they read in it."""

    examples: Examples

    name = "commands"
    share = 1.0

    def __post_init__(self) -> None:
        tuple(self._inputs())  # made now, not while a command is judged

    def attempt(self, seed: int, number: int) -> None:
        """Run a command with one to three wrong words."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
        words = _spoilt(pick(rng, COMMANDS), rng)
        with TemporaryDirectory() as top, _harmless():
            folder = Path(top, "a", "b", "c", "d")
            folder.mkdir(parents=True)
            for file in self._inputs():
                shutil.copy(file, folder)
            with chdir(folder):
                run([*words, *_END.get(words[0] if words else "", ())])

    def _inputs(self) -> Iterator[Path]:
        for name in ("plan.json", "three_boxes.json", "observed/state.json"):
            yield self.examples.scenes / name
        yield self.examples.parameters / "params.yaml"
        yield self.examples.parameters / "planning.yaml"


def run(words: list[str]) -> str:
    """Run a command in this process.

    Returns:
        What it writes to standard output.

    Raises:
        InputError: it refuses its input in one line, with code 2.
        RuntimeError: it ends otherwise than it may.
    """
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace") for _ in range(2))
    with redirect_stdout(out), redirect_stderr(err):
        try:
            cli.main(words)
        except SystemExit as end:
            code = end.code
    said = err.buffer.getvalue().decode() if not err.flush() else ""
    if code == 2:
        lines = said.splitlines()
        if (
            len(lines) != 1
            or len(lines[0]) > LONGEST + len("error: ")
            or not lines[0].isprintable()
        ):
            raise RuntimeError(f"{words}: not one line: {said!r}")
        raise InputError(lines[0], "")
    if code not in (0, 1, None):
        raise RuntimeError(f"{words}: {code}: {said}")
    out.flush()
    return out.buffer.getvalue().decode()


def _spoilt(words: tuple[str, ...], rng: Rng) -> list[str]:
    found = list(words)
    for _ in range(int(rng.integers(1, 4))):
        place = int(rng.integers(len(found) + 1))
        match int(rng.integers(4)):
            case 0:
                found[place : place + 1] = []
            case 1:
                found.insert(place, pick(rng, _WORDS))
            case 2:
                found[place : place + 1] = [pick(rng, words) + pick(rng, (*NAMES, "", "=1"))]
            case _:
                found[place : place + 1] = [str(pick(rng, ODD))]
    return [_as_argument(word) for word in found]


def _as_argument(word: str) -> str:
    """What the operating system can hand over, and no path out of the folder."""
    plain = os.fsdecode(word.encode("utf-8", "surrogatepass").replace(b"\0", b""))
    return plain.replace("/etc", "etc").replace("/dev", "dev")


@contextmanager
def _harmless() -> Iterator[None]:
    """No server is started, no stage computes, nothing is carried out or recorded."""
    cases = (f"guided_lgp.cases.{name}" for name in _CASES)
    modules = map(import_module, (*cli.STAGES.values(), *cases))
    runs = [patch.object(module, "run", Mock()) for module in modules]
    runs += [
        patch(f"guided_lgp.{place}", Mock(side_effect=SystemExit(0)))
        for place in ("replanning.replan", "replanning.follow", "bounds.execution.execute")
    ]
    view = patch.object(import_module("guided_lgp.view.live"), "view", Mock())
    others = (
        patch.object(tracking, "recorded", lambda *_: nullcontext()),
        patch.object(tracking, "prepare", Mock()),
        patch.object(os, "execv", Mock(side_effect=SystemExit(0))),
        patch.object(sys, "argv", [str(ROOT / "guided-lgp")]),
    )
    with view, others[0], others[1], others[2], others[3]:
        for one in runs:
            one.start()
        try:
            yield
        finally:
            for one in runs:
                one.stop()
