"""The same bytes wherever the program runs: homes, caches, locales, paths, threads, masks."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

from hostility.examples import ROOT
from hostility.figures import Counted
from hostility.kills import contents

LIMIT_S = 1200
WORK = """
import os, sys
from pathlib import Path
root = Path(sys.argv[1])
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.experiments import build_dataset, enumerate_sequences, generate_scenes
from guided_lgp.experiments import train_relational
from guided_lgp.export import export_plan
from guided_lgp.bounds.plan_file import read_plan
from guided_lgp.logic import parse_objective
from guided_lgp.params import load_params
from guided_lgp.planning import plan
from guided_lgp.scene import load_scene

params = load_params(root / "params.yaml")
for stage in (generate_scenes, enumerate_sequences, build_dataset, train_relational):
    stage.run(params, root)
scene, goals = load_scene(root / "scene.json"), parse_objective(["(on red green)"])
found = plan(scene, goals, params=params)
write_plan(root / "data" / "plan.json", scene, goals, found.path, {})
export_plan(read_plan(root / "data" / "plan.json"), root / "data" / "plan.csv")
"""
"""Four stages of the small profile, a plan and its motion."""


@dataclass(frozen=True)
class Environment:
    """How a run differs from an ordinary one."""

    name: str
    variables: Mapping[str, str | None] = field(default_factory=dict)
    """None: the variable is not there."""
    folder: str = "run"
    umask: int = 0o022
    elsewhere: bool = False
    """Whether the working directory is another one."""


ENVIRONMENTS = (
    Environment("no HOME", {"HOME": None, "XDG_CACHE_HOME": None}),
    Environment("a relative XDG_CACHE_HOME", {"XDG_CACHE_HOME": "cache"}),
    Environment("another locale", {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0"}),
    Environment("spaces and umlauts in the path", folder="ein Ordner für Äpfel"),
    Environment("one thread", {"OMP_NUM_THREADS": "1"}),
    Environment("eight threads", {"OMP_NUM_THREADS": "8", "OPENBLAS_NUM_THREADS": "8"}),
    Environment("an umask that closes", umask=0o077),
    Environment("another working directory", elsewhere=True),
)


@dataclass
class Figures(Counted):
    """Environments that were tried, and those whose bytes were others."""

    tried: int = 0
    different: int = 0


def digests(environment: Environment, folder: Path, cache: Path) -> dict[str, str]:
    """Run in an environment: the digest of every file that was written.

    Args:
        environment: what is special.
        folder: empty, for the run.
        cache: of compiled code, copied to the home of the run.
    """
    root = folder / environment.folder
    root.mkdir(parents=True)
    for name, source in {
        "params.yaml": ROOT / "tests" / "params.yaml",
        "dvc.yaml": ROOT / "dvc.yaml",
        "scene.json": ROOT / "examples" / "three_boxes.json",
    }.items():
        shutil.copy(source, root / name)
    (root / "src").symlink_to(ROOT / "src")
    home = folder / "home"
    if cache.is_dir():
        shutil.copytree(cache, home / ".cache" / "guided-lgp", copy_function=shutil.copy2)
    variables = {"HOME": str(home), "XDG_CACHE_HOME": None, **environment.variables}
    kept = {name: value for name, value in os.environ.items() if name not in variables}
    chosen = kept | {name: value for name, value in variables.items() if value is not None}
    command = [sys.executable, "-c", WORK, str(root if environment.elsewhere else Path())]
    done = subprocess.run(
        command,
        cwd=folder if environment.elsewhere else root,
        env=chosen,
        umask=environment.umask,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=LIMIT_S,
        check=False,
    )
    if done.returncode != 0:
        return {"error": done.stderr.decode(errors="replace")[-1000:]}
    found = contents(root / "data") | contents(root / "models") | contents(root / "reports")
    return {name: sha256(content).hexdigest() for name, content in found.items()}


def compare(
    ordinary: Mapping[str, str], found: Mapping[str, str], name: str, figures: Figures
) -> None:
    """Count an environment."""
    figures.tried += 1
    names = sorted(ordinary.keys() | found.keys())
    other = [file for file in names if ordinary.get(file) != found.get(file)]
    if other:
        figures.fault("different", f"{name}: {other} {json.dumps(found.get('error'))}")


def all_environments(folder: Path, cache: Path, figures: Figures) -> None:
    """Compare every environment with an ordinary run."""
    ordinary = digests(Environment("ordinary"), folder / "ordinary", cache)
    assert "error" not in ordinary, ordinary["error"]
    for environment in ENVIRONMENTS:
        place = folder / environment.name.replace(" ", "-")
        compare(ordinary, digests(environment, place, cache), environment.name, figures)
        print(f"{environment.name}: {len(ordinary)} files compared", flush=True)
