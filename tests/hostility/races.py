"""Two to four processes at once: readers find something whole, and nobody's result is lost."""

import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.synchronize import Event
from pathlib import Path

from guided_lgp import tracking
from guided_lgp.documents import write_text
from guided_lgp.tracking.database import search
from hostility.examples import ROOT
from hostility.figures import Counted
from hostility.kills import contents
from load import PIPELINE

LIMIT_S = 600
PARAMS = ROOT / "tests" / "params.yaml"
SCENE = ROOT / "examples" / "three_boxes.json"
_SIZE = 5000


@dataclass
class Figures(Counted):
    """Processes that ran at once, reads that were torn, results that were lost."""

    runs: int = 0
    torn: int = 0
    lost: int = 0


Write = Callable[[Path, str], object]


def write_at_once(
    folder: Path, figures: Figures, writes: int, write: Write = write_text, writers: int = 4
) -> None:
    """Writers of one file, each with a content of its own, and two readers all along."""
    context = multiprocessing.get_context("fork")
    file, done = folder / "file.txt", context.Event()
    write(file, "0" * _SIZE)
    torn = context.Value("i", 0)

    def write_often(letter: str) -> None:
        for _ in range(writes):
            write(file, letter * _SIZE)

    def read_often(done: Event) -> None:
        while not done.is_set():
            found = file.read_text() if file.exists() else ""
            if len(found) != _SIZE or len(set(found)) != 1:
                with torn.get_lock():
                    torn.value += 1

    readers = [context.Process(target=read_often, args=(done,)) for _ in range(2)]
    at_work = [context.Process(target=write_often, args=("abcd"[n],)) for n in range(writers)]
    for process in (*readers, *at_work):
        process.start()
    for process in at_work:
        process.join()
    done.set()
    for process in readers:
        process.join()
    figures.runs += writers
    figures.torn += torn.value
    if file.read_text()[:1] not in "abcd"[:writers] or any(p.exitcode for p in at_work):
        figures.fault("lost", "writers of one file: none of the contents stayed")


def together(
    commands: Sequence[Sequence[str]], folder: Path, **variables: str
) -> list[tuple[int, str]]:
    """Run commands at once: the code and the error output of each."""
    processes = [
        subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | {"OMP_NUM_THREADS": "1"} | variables,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for command in commands
    ]
    said = [process.communicate(timeout=LIMIT_S)[1] for process in processes]
    return [(p.returncode, text) for p, text in zip(processes, said, strict=True)]


PROGRAM = (sys.executable, "-c", "import sys; from guided_lgp.cli import main; main(sys.argv[1:])")


def plan_at_once(folder: Path, figures: Figures) -> None:
    """Four plans into one file, with nothing in the cache."""
    out = folder / "plan.json"
    words = ["plan", str(SCENE), "--goal", "(on red green)", "--out", str(out)]
    for code, said in together([[*PROGRAM, *words]] * 4, folder, XDG_CACHE_HOME=str(folder / "c")):
        figures.runs += 1
        if code != 0:
            figures.fault("lost", f"plan ended with {code}: {said}")
    json.loads(out.read_text())


_SEVEN = """
from guided_lgp.compiled import load_compiled
assert load_compiled("seven", "int seven(void) { return 7; }").seven() == 7
"""


def compile_at_once(folder: Path, figures: Figures) -> None:
    """Four processes that want the same library, with nothing in the cache."""
    command = [sys.executable, "-c", _SEVEN]
    for code, said in together([command] * 4, folder, XDG_CACHE_HOME=str(folder)):
        figures.runs += 1
        if code != 0:
            figures.fault("lost", f"a library was not there: {said}")


_REPAIR = "from guided_lgp.doctor import repair; repair()"


def repair_at_once(folder: Path, figures: Figures) -> None:
    """Two repairs of a damaged cache, while two processes want what is in it."""
    variables = {"XDG_CACHE_HOME": str(folder)}
    wanted, repair = ([sys.executable, "-c", code] for code in (_SEVEN, _REPAIR))
    together([wanted], folder, **variables)
    for library in (folder / "guided-lgp").glob("seven-*.so"):
        library.write_bytes(b"no library")
    for code, said in together([wanted, repair, repair, wanted], folder, **variables):
        figures.runs += 1
        if code != 0:
            figures.fault("lost", f"a repair or what came with it ended with {code}: {said}")


def run_stage_at_once(folder: Path, figures: Figures, processes: int) -> None:
    """Runs of one stage in one clone: one writes all files, the others wait or are refused."""
    roots = [folder / "alone", folder / "together"]
    for root in roots:
        (root / ".dvc").mkdir(parents=True)
        shutil.copy(PARAMS, root / "params.yaml")
    command = [*PROGRAM, "generate_scenes"]
    variables = {"MLFLOW_TRACKING_URI": f"sqlite:///{folder / 'mlflow.db'}"}
    together([command], roots[0], **variables)
    for code, said in together([command] * processes, roots[1], **variables):
        figures.runs += 1
        if code not in (0, 2) or (code == 2 and "runs already in this clone: process" not in said):
            figures.fault("lost", f"a stage ended with {code}: {said}")
    alone, both = (contents(root / "data") for root in roots)
    figures.torn += sum(both[name] != alone[name] for name in both.keys() & alone.keys())
    for name in alone.keys() - both.keys():
        figures.fault("lost", f"{name} is not there")


_RECORD = """
from pathlib import Path
from guided_lgp import tracking
from guided_lgp.params import load_params
with tracking.recorded("generate_scenes", load_params(Path("params.yaml"))):
    pass
"""


def record_at_once(folder: Path, figures: Figures, processes: int = 4) -> None:
    """Stages that all create the database of runs."""
    (folder / "reports" / "training").mkdir(parents=True)
    shutil.copy(ROOT / "params.yaml", folder)
    shutil.copy(ROOT / "reports" / "training" / "place.json", folder / "place.json")
    (folder / "dvc.yaml").write_text(PIPELINE)
    (folder / ".dvc").mkdir()
    (folder / ".dvc" / "config").write_text("[core]\n    no_scm = true\n    analytics = false\n")
    database = f"sqlite:///{folder / 'mlflow.db'}"
    command = [sys.executable, "-c", _RECORD]
    said = together([command] * processes, folder, MLFLOW_TRACKING_URI=database)
    figures.runs += processes
    os.environ["MLFLOW_TRACKING_URI"] = database
    found = list(search(tracking.prepare(), f"tags.`{tracking.STAGE_TAG}` != ''"))
    finished = sum(run.info.status == "FINISHED" for run in found)
    for _ in range(processes - finished):
        figures.fault(
            "lost", f"{finished} of {processes} stages recorded: {[line for _, line in said]}"
        )


def all_races(folder: Path, figures: Figures) -> None:
    """Everything, in folders of its own."""
    for name, work in {
        "writers": lambda at: write_at_once(at, figures, 1000),
        "plans": lambda at: plan_at_once(at, figures),
        **{f"compiled-{n}": lambda at: compile_at_once(at, figures) for n in range(5)},
        **{f"repairs-{n}": lambda at: repair_at_once(at, figures) for n in range(5)},
        **{f"stages-{n}": lambda at, n=n: run_stage_at_once(at, figures, n) for n in (2, 3, 4)},
        **{f"mlflow-{n}": lambda at, n=n: record_at_once(at, figures, n) for n in (2, 3, 4)},
    }.items():
        start = time.monotonic()
        (folder / name).mkdir(parents=True)
        work(folder / name)
        print(f"race of {name}: {time.monotonic() - start:.0f} s", flush=True)
