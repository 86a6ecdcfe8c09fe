"""The sources of every stage: what of the package it loads and reads while it runs.

``python tests/stage_sources.py`` (``make sources``) runs all stages at a tiny scale and writes the
lists of sources in ``dvc.yaml``, ``studies/dvc.yaml`` and ``cases/dvc.yaml`` anew;
``test_stage_sources.py`` compares.
"""

import ast
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from itertools import zip_longest
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest import mock

import yaml

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path("src", "guided_lgp")
DESCRIPTIONS = PACKAGE / "shipped" / "robots"
"""A folder per robot: meshes, which PyBullet and pinocchio open unseen, and what names them."""
NETWORKS = ("instruction", "grasp", "place")
FAMILIES = ("rows", "rows_decoys")

Stage = tuple[str, str]
"""A file of stages, and one of its stages."""
Call = tuple[str, str, tuple[object, ...]]
"""Module, function and further arguments of a run in a folder."""

PIPELINE, STUDIES, CASES = "dvc.yaml", "studies/dvc.yaml", "cases/dvc.yaml"


def _stage(name: str, *arguments: object, room: str = "experiments") -> Call:
    return f"guided_lgp.{room}.{name}", "run", arguments


def _study(module: str, function: str, *arguments: str) -> Call:
    return f"guided_lgp.studies.{module}", function, arguments


RUNS: Mapping[Stage, Sequence[Call]] = {
    (PIPELINE, "generate_scenes"): [_stage("generate_scenes")],
    (PIPELINE, "enumerate_sequences"): [_stage("enumerate_sequences")],
    (PIPELINE, "build_dataset"): [_stage("build_dataset")],
    (PIPELINE, "train_policy"): [_stage("train_policy", network) for network in NETWORKS],
    (PIPELINE, "train_improved"): [_stage("train_improved", network) for network in NETWORKS],
    (PIPELINE, "train_relational"): [_stage("train_relational")],
    (PIPELINE, "evaluate_generalization"): [_stage("evaluate_generalization")],
    (PIPELINE, "compare_scalability"): [_stage("compare_scalability")],
    (PIPELINE, "render_reports"): [_stage("render", room="report")],
    (STUDIES, "train"): [
        _study("train", "train", case) for case in ("paper", "improved", "relational")
    ],
    (STUDIES, "spread"): [_study("evaluate", "evaluate", "spread")],
    (STUDIES, "evaluate"): [
        _study("evaluate", "evaluate", table)
        for table in ("ablations", "data_efficiency", "shuffled_labels")
    ],
    (STUDIES, "feasibility"): [_study("feasibility", "run")],
    (STUDIES, "render"): [_study("tables", "render")],
    (CASES, "demonstrate"): [_stage("demonstrate", case, room="cases") for case in FAMILIES],
    (CASES, "train_case"): [_stage("train", case, 1, room="cases") for case in FAMILIES],
    (CASES, "evaluate_case"): [
        _stage("evaluate", case, training, room="cases")
        for case in FAMILIES
        for training in ("rivals", "1")
    ],
    (CASES, "replay_case"): [_stage("replay", case, room="cases") for case in FAMILIES],
    (CASES, "collect_cases"): [_stage("collect", room="cases")],
}
"""Every stage, after those whose output it needs."""

_INFRASTRUCTURE = [
    "cache",
    "documents",
    "errors",
    "faults",
    "parallel",
    "params",
    "paths",
    "sources",
    "strict_yaml",
    "tables",
]
INFRASTRUCTURE = {PACKAGE / f"{name}.py" for name in ("__init__", *_INFRASTRUCTURE)}
"""What does not determine a stage's results: fan-out, messages, places."""
_COARSE_ONLY = [(PIPELINE, "enumerate_sequences"), (CASES, "demonstrate")]
UNUSED = dict.fromkeys(_COARSE_ONLY, PACKAGE / "bounds" / "path")
"""What a stage loads without calling it."""
HOUSES = {
    PACKAGE / name for name in ("domains", "robots", "bounds/terms", "policy", "scene/families")
}
"""Folders that are searched for declarations; they are listed file by file."""

_LIBRARIES = (
    "casadi",
    "coal",
    "joblib",
    "matplotlib.pyplot",
    "numpy",
    "pandas",
    "pinocchio",
    "pyarrow.parquet",
    "pydantic",
    "torch",
)
"""What takes long to load, none of it of the package."""
_FOUND = "found: "
"""What a line with the files of a stage begins with."""

_NETWORK = {
    "layers": 1,
    "nodes": 8,
    "dropout": 0.1,
    "l2": 0.0,
    "epochs": 1,
    "batch": 256,
    "lr": 0.1,
}
_TRAINING = {"patience": 1, "validation_share": 0.4}
_LIMITS = {"max_depth": 2, "max_tree_size": 10, "max_paths": 1, "max_sequences": 2}
TINY: Mapping[str, Mapping[str, object]] = {
    "parallel": {"workers": 1},  # in the process that notes
    "bounds": {"coarse_restarts": 1, "path_solutions": 1},
    "train_policy": _TRAINING | dict.fromkeys(NETWORKS, _NETWORK),
    "train_improved": _TRAINING | dict.fromkeys(NETWORKS, _NETWORK),
    "train_relational": _TRAINING | {"epochs": 1},
    "evaluate_generalization": _LIMITS,
    "compare_scalability": _LIMITS,
}
"""What differs from the small profile."""


def write_tiny_parameters(root: Path) -> None:
    """The parameters of the pipeline, the cases and the studies at a tiny scale."""
    small = yaml.safe_load((ROOT / "tests" / "params.yaml").read_text())
    tiny = {section: values | TINY.get(section, {}) for section, values in small.items()}
    tiny["cases"] = {name: case | {"seeds": [1]} for name, case in small["cases"].items()}
    (root / "params.yaml").write_text(yaml.safe_dump(tiny))
    study = yaml.safe_load((ROOT / "studies" / "params.yaml").read_text())
    cases = {name: study["cases"][name] | {"configurations": 3} for name in ("paper", "relational")}
    cases["improved"] = study["cases"]["improved"] | {"configurations": 2}
    tables = {name: table | {"cases": list(cases)} for name, table in study["tables"].items()}
    study |= {"seeds": study["seeds"][:1], "cases": cases, "tables": tables}
    study["limits"] |= _LIMITS
    study["feasibility"]["network"] = _NETWORK
    (root / "studies").mkdir()
    (root / "studies" / "params.yaml").write_text(yaml.safe_dump(study))


def run_all(root: Path) -> Iterator[tuple[Stage, frozenset[Path]]]:
    """Run every stage in an empty folder, each in a process of its own; the sources of each.

    These processes are forks of one that has loaded the libraries, and nothing of the package.
    """
    write_tiny_parameters(root)
    for file in (PIPELINE, STUDIES, CASES):
        (root / file).parent.mkdir(exist_ok=True)
        (root / file).write_bytes((ROOT / file).read_bytes())
    command = [sys.executable, __file__, json.dumps(list(RUNS.values()))]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    lines = [line.removeprefix(_FOUND) for line in done.stdout.splitlines() if _FOUND in line]
    for stage, line in zip_longest(RUNS, lines):
        if line is None:
            raise RuntimeError(f"{stage}: {done.stderr}")
        yield stage, _of_the_package(json.loads(line), UNUSED.get(stage))


def fork_for_each(runs: Sequence[Sequence[Call]]) -> int:
    """Run stages one after the other, each in a fork; 1 as soon as one of them fails."""
    for name in _LIBRARIES:
        import_module(name)
    for calls in runs:
        process = get_context("fork").Process(target=_say_what_is_used, args=(calls,))
        process.start()
        process.join()
        if process.exitcode:
            return 1
    return 0


def _say_what_is_used(calls: Sequence[Call]) -> None:
    print(f"{_FOUND}{json.dumps(sorted(run_noting(calls)))}", flush=True)


def run_noting(calls: Iterable[Call]) -> set[str]:
    """Run a stage in the working directory; the files of all modules loaded, and all files read."""
    read: set[str] = set()

    def note(event: str, values: tuple[object, ...]) -> None:
        if event == "open" and isinstance(values[0], str):
            read.add(values[0])

    sys.addaudithook(note)
    folder = Path.cwd()
    with mock.patch("guided_lgp.sources.source_digest", return_value=""):  # reads what is listed
        for module, function, arguments in calls:
            run: Callable[..., None] = getattr(import_module(module), function)
            if module.startswith("guided_lgp.studies"):
                run(folder, *arguments)
            else:
                from guided_lgp.params import load_params

                run(load_params(folder / "params.yaml"), folder, *arguments)
    loaded = {getattr(module, "__file__", None) or "" for module in list(sys.modules.values())}
    return loaded | {file for file in read if not file.endswith((".py", ".pyc"))}


def _of_the_package(files: Iterable[str], unused: Path | None) -> frozenset[Path]:
    """Those that determine results, relative to the clone; of a robot's description its folder."""
    paths = map(Path, files)
    inside = {path.relative_to(ROOT) for path in paths if path.is_relative_to(ROOT / PACKAGE)}
    wanted = {
        DESCRIPTIONS / file.relative_to(DESCRIPTIONS).parts[0]
        if file.is_relative_to(DESCRIPTIONS)
        else file
        for file in inside - INFRASTRUCTURE
        if unused is None or not file.is_relative_to(unused)
    }
    return frozenset(file for file in wanted if not _is_empty(file))


def _is_empty(file: Path) -> bool:
    """Whether a file is the beginning of a package that has nothing but a sentence."""
    return file.name == "__init__.py" and len(ast.parse((ROOT / file).read_text()).body) <= 1


def listed(sources: Collection[Path]) -> list[str]:
    """The shortest list of sources: a folder in place of its modules where all of them are used."""
    shortest: set[Path] = set()
    for source in sources:
        folders = [source, *source.parents[: -len(PACKAGE.parts) - 1]]
        shortest.add(next(folder for folder in reversed(folders) if _all_used(folder, sources)))
    return sorted(map(str, shortest))


def _all_used(path: Path, sources: Collection[Path]) -> bool:
    if path in sources or path in HOUSES:
        return path in sources
    modules = [file.relative_to(ROOT) for file in (ROOT / path).rglob("*.py")]
    used = [file in sources or _is_empty(file) for file in modules]
    return bool(modules) and all(used)


def dependencies(stage: Stage) -> list[str]:
    """The dependencies of a stage, as declared."""
    file, name = stage
    declared: dict[str, Any] = yaml.safe_load((ROOT / file).read_text())["stages"][name]
    deps: list[str] = declared.get("do", declared)["deps"]
    return deps


def is_source(dependency: str) -> bool:
    """Whether a dependency is one of the sources that a stage loads or reads."""
    return Path(dependency).is_relative_to(PACKAGE)


def write_lists(found: Mapping[Stage, Collection[Path]]) -> None:
    """Put the lists of sources in place of those of the files of stages."""
    for (file, name), sources in found.items():
        text = (ROOT / file).read_text()
        begin = re.search(rf"^  {name}:$", text, re.MULTILINE)
        assert begin is not None
        head, body = text[: begin.end()], text[begin.end() :]
        old = re.search(rf"(^ +- ){PACKAGE}/\S+\n(?: +- {PACKAGE}/\S+\n)*", body, re.MULTILINE)
        assert old is not None
        new = "".join(f"{old[1]}{source}\n" for source in listed(sources))
        (ROOT / file).write_text(head + body[: old.start()] + new + body[old.end() :])


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit(fork_for_each(json.loads(sys.argv[1])))
    else:
        with tempfile.TemporaryDirectory() as folder:
            write_lists(dict(run_all(Path(folder))))
