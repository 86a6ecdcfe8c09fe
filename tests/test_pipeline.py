"""The pipeline: its declaration, and its small profile end to end through DVC."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import grimp
import pytest
import yaml

from determinism import TIMING, differences
from guided_lgp.cli import STAGES
from guided_lgp.documents import remove
from guided_lgp.params import Params, load_params
from guided_lgp.policy.paper.encoding import Encoding
from stage_sources import CASES as CASES_FILE
from stage_sources import INFRASTRUCTURE, PIPELINE, RUNS, UNUSED, Call

ROOT = Path(__file__).parents[1]
PARAMS = load_params(ROOT / "params.yaml")
STUDIES = {
    "train": "guided_lgp.studies.train",
    "spread": "guided_lgp.studies.evaluate",
    "evaluate": "guided_lgp.studies.evaluate",
    "feasibility": "guided_lgp.studies.feasibility",
    "render": "guided_lgp.studies.tables",
}
"""The stages of the studies and the modules that run them."""

CASES = {
    "demonstrate": "guided_lgp.cases.demonstrate",
    "train_case": "guided_lgp.cases.train",
    "evaluate_case": "guided_lgp.cases.evaluate",
    "replay_case": "guided_lgp.cases.replay",
    "collect_cases": "guided_lgp.cases.collect",
}
"""Those of the cases."""


def pipeline() -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load((ROOT / "dvc.yaml").read_text())
    return document


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_depends_on_its_script_and_its_sources(stage: str) -> None:
    deps = pipeline()["stages"][stage]["deps"]
    assert f"stages/{stage}.py" in deps
    missing = missing_sources(STAGES[stage], deps, UNUSED.get((PIPELINE, stage)))
    assert not missing, f"{stage}: {missing}"


def test_the_studies_depend_on_their_script_and_their_sources() -> None:
    stages = yaml.safe_load((ROOT / "studies" / "dvc.yaml").read_text())["stages"]
    assert set(stages) == set(STUDIES)
    for stage, module in STUDIES.items():
        deps = stages[stage].get("do", stages[stage])["deps"]
        assert "studies/run.py" in deps
        missing = missing_sources(module, deps)
        assert not missing, f"{stage}: {missing}"


def test_the_cases_depend_on_their_sources_and_are_those_of_the_parameters() -> None:
    stages = yaml.safe_load((ROOT / "cases" / "dvc.yaml").read_text())["stages"]
    assert set(stages) == set(CASES)
    for stage, module in CASES.items():
        deps = stages[stage].get("do", stages[stage])["deps"]
        missing = missing_sources(module, deps, UNUSED.get((CASES_FILE, stage)))
        assert not missing, f"{stage}: {missing}"
    names = list(PARAMS.cases)
    assert stages["demonstrate"]["foreach"] == stages["replay_case"]["foreach"] == names
    for stage in ("train_case", "evaluate_case"):
        assert stages[stage]["matrix"]["case"] == names
    for case in PARAMS.cases.values():
        assert tuple(stages["train_case"]["matrix"]["seed"]) == case.seeds
        assert tuple(stages["evaluate_case"]["matrix"]["training"]) == ("rivals", *case.seeds)


@cache
def imports() -> grimp.ImportGraph:
    """Which module imports which, but for the sake of types."""
    return grimp.build_graph("guided_lgp", exclude_type_checking_imports=True)


def missing_sources(module: str, deps: list[str], unused: Path | None = None) -> list[str]:
    """Sources that a module imports by name, and that the dependencies lack.

    What is found by other means, only a run shows: see ``test_stage_sources.py``.
    """
    graph = imports()
    missing = []
    for name in sorted({module} | graph.find_upstream_modules(module)):
        file = Path("src", *name.split(".")).with_suffix(".py")
        needed = (ROOT / file).is_file() and file not in INFRASTRUCTURE
        if needed and not {str(path) for path in (file, *file.parents)} & set(deps):
            missing.append(file)
    return [str(file) for file in missing if unused is None or not file.is_relative_to(unused)]


def test_every_dependency_exists_or_is_made_by_a_stage() -> None:
    stages = pipeline()["stages"]
    networks = list(Encoding().chains)
    for stage, settings in (
        ("train_policy", PARAMS.train_policy),
        ("train_improved", PARAMS.train_improved),
    ):
        assert stages[stage]["matrix"]["network"] == networks
        assert list(settings.networks) == networks
    made = written_files()
    for stage in stages.values():
        for dependency in stage["deps"]:
            assert dependency in made or (ROOT / dependency).exists(), dependency


def written_files() -> set[str]:
    """The files and folders that the stages write."""
    names = set()
    for stage in pipeline()["stages"].values():
        for out in stage["outs"]:
            name = out if isinstance(out, str) else next(iter(out))
            names |= {name.replace("${item.network}", network) for network in Encoding().chains}
    return names


def test_stages_read_declared_parameters_only() -> None:
    sections = {name for name in Params.model_fields if name not in ("parallel", "bounds", "cases")}
    assert sections < set(pipeline()["stages"])
    assert list(STAGES) == list(pipeline()["stages"])


def test_the_small_profile_has_the_same_keys() -> None:
    load_params(ROOT / "tests" / "params.yaml")


def test_a_changed_and_a_missing_output_are_differences(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name / "data").mkdir(parents=True)
        for file in ("same", "changed"):
            (tmp_path / name / "data" / file).write_text(file)
    folders = tmp_path / "one", tmp_path / "two"
    assert list(differences(*folders)) == []
    (folders[1] / "data" / "changed").write_text("otherwise")
    (folders[0] / "data" / "new").touch()
    expected = ["data/changed: differs in two", "data/new: written in one only"]
    assert list(differences(*folders)) == expected


_IN_ONE_PROCESS = """
import json, sys
from importlib import import_module
from pathlib import Path
from guided_lgp.params import load_params

root = Path.cwd()
for module, function, arguments in json.loads(sys.argv[1]):
    getattr(import_module(module), function)(load_params(root / "params.yaml"), root, *arguments)
"""


class Clone:
    """A clone in a temporary folder, and commands in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self._environment = {
            name: value for name, value in os.environ.items() if not name.startswith("DVC_")
        } | {"PATH": path, "OMP_NUM_THREADS": "1", "MLFLOW_TRACKING_URI": self.uri}

    @classmethod
    def of_the_working_tree(cls, folder: Path) -> "Clone":
        clone = cls(folder)
        listing = clone._run("git", "ls-files", "-co", "--exclude-standard", where=ROOT).stdout
        for name in listing.splitlines():
            if name.startswith("src/guided_lgp") or (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, folder / name)
        clone.git("init", "-q")
        clone.commit()
        return clone

    def commit(self) -> None:
        self.git("add", "-A")
        self.git("-c", "user.name=test", "-c", "user.email=test@localhost", "commit", "-qm", "test")

    @property
    def uri(self) -> str:
        return f"sqlite:///{self.folder / 'mlflow.db'}"

    def git(self, *arguments: str) -> None:
        self._run("git", *arguments)

    def dvc(self, *arguments: str) -> str:
        return self.command("dvc", *arguments)

    def command(self, *words: str) -> str:
        """What a command prints; it must succeed."""
        done = self._run(*words)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return self._run(sys.executable, *arguments)

    def stages(self, calls: Sequence[Call]) -> None:
        """Run stages in one process, without DVC and MLflow."""
        done = self.run("-c", _IN_ONE_PROCESS, json.dumps(calls))
        assert done.returncode == 0, done.stderr

    def lock(self) -> dict[str, Any]:
        stages: dict[str, Any] = yaml.safe_load((self.folder / "dvc.lock").read_text())["stages"]
        return stages

    def _run(self, *command: str, where: Path | None = None) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            cwd=where or self.folder,
            env=self._environment,
            text=True,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Clone:
    """The small profile after one run of the whole pipeline, as the README has it run."""
    sources = Clone.of_the_working_tree(tmp_path_factory.mktemp("clone"))
    (sources.folder / ".venv").symlink_to(sys.prefix)
    output = sources.command("make", "--old-file=.venv/.installed", "quick")
    assert "MLflow: not recorded" not in output
    clone = Clone(sources.folder / "quick")
    clone.commit()
    return clone


def commands(page: Path) -> list[str]:
    """The lines of the blocks of shell commands in a page."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    return "".join(blocks).splitlines()


@pytest.mark.pipeline
class TestSmallProfile:
    """In the order of a user's day: run, look, change a parameter, make a mistake."""

    def test_a_run_writes_models_metrics_and_reports(self, clone: Clone) -> None:
        reports = clone.folder / "reports"
        metrics = {
            name: json.loads((reports / "metrics" / f"{name}.json").read_text())
            for name in (
                "generalization",
                "scalability",
                "scalability_timing",
                "summary",
                "training",
            )
        }
        shares = metrics["generalization"]["adaptation"]["all"]
        assert 0 < shares["n"] <= 87
        assert sum(shares[key] for key in ("shortest", "feasible", "no_solution")) == (
            pytest.approx(1)
        )
        assert metrics["scalability"]["a.1"]["breadth_first"]["objectives"] == 9
        assert metrics["scalability_timing"]["a.1"]["guided"]["peak_rss_mb"] > 0
        assert set(metrics["training"]) >= {"instruction", "grasp", "place"}
        for network in ("instruction", "grasp", "place"):
            assert (clone.folder / "models" / f"{network}.safetensors").stat().st_size > 1000
        page = (reports / "report.md").read_text()
        assert "Table I" in page
        assert "Table III" in page

    def test_one_worker_writes_the_same_bytes(self, clone: Clone, tmp_path: Path) -> None:
        alone = Clone.of_the_working_tree(tmp_path)
        params = (ROOT / "tests" / "params.yaml").read_text()
        (tmp_path / "params.yaml").write_text(params.replace("workers: 2", "workers: 1"))
        for name in written_files():
            remove(tmp_path / name)
        *computing, rendering = [
            call for (file, _), calls in RUNS.items() if file == PIPELINE for call in calls
        ]
        alone.stages(computing)
        assert (alone.folder / TIMING).read_bytes() != (clone.folder / TIMING).read_bytes()
        shutil.copy(clone.folder / TIMING, alone.folder / TIMING)
        alone.stages([rendering])
        assert list(differences(alone.folder, clone.folder)) == []

    def test_a_second_run_does_nothing_within_seconds(self, clone: Clone) -> None:
        start = time.monotonic()
        output = clone.dvc("repro")
        assert "Running stage" not in output
        assert time.monotonic() - start < 20
        assert "up to date" in clone.dvc("status", "dvc.yaml")

    def test_mlflow_has_a_child_per_stage_and_sync_adds_nothing(self, clone: Clone) -> None:
        from mlflow import MlflowClient

        client = MlflowClient(clone.uri)
        experiment = client.get_experiment_by_name("guided-lgp")
        assert experiment is not None
        runs = client.search_runs([experiment.experiment_id])
        parents = [run for run in runs if "mlflow.parentRunId" not in run.data.tags]
        assert len(parents) == 1
        assert "shortest/default" in parents[0].data.metrics
        names = {model.name for model in client.search_registered_models()}
        assert {"guided-lgp-place", "guided-lgp-improved-place", "guided-lgp-relational"} <= names
        children = [run for run in runs if run not in parents]
        assert {run.info.status for run in runs} == {"FINISHED"}
        stages = list(clone.lock())
        assert sorted(run.data.tags["guided_lgp.stage"] for run in children) == sorted(stages)
        synced = clone.run("-m", "guided_lgp.cli", "mlflow", "sync")
        assert "recorded 0 stages" in synced.stdout, synced.stderr
        assert len(client.search_runs([experiment.experiment_id])) == len(runs)

    def test_metrics_plots_and_graph_can_be_shown(self, clone: Clone) -> None:
        assert "summary.json" in clone.dvc("metrics", "show")
        assert "peak_rss_mb" in clone.dvc("metrics", "show", str(TIMING))
        assert "index.html" in clone.dvc("plots", "show")
        assert "train_policy@place" in clone.dvc("dag")

    def test_the_page_on_experiments_runs_as_written(self, clone: Clone, tmp_path: Path) -> None:
        before = clone.lock()
        run, show, diff, mlflow, times, back, remote, push = commands(ROOT / "docs/experiments.md")
        output = clone.command("bash", "-euc", run)
        after = ["evaluate_generalization", "compare_scalability", "render_reports"]
        changed = [name for name, stage in clone.lock().items() if stage != before[name]]
        assert sorted(changed) == sorted(["train_policy@place", *after])
        assert sorted(re.findall(r"Running stage '([\w@]+)'", output)) == sorted(changed)
        assert "dropout" in clone.command("bash", "-euc", show)
        assert "index.html" in clone.command("bash", "-euc", diff)
        assert 0 < clone.dvc("metrics", "diff", "--all").count("summary.json") <= 15
        assert mlflow.startswith("make mlflow")
        assert "a.1" in clone.command("bash", "-euc", times)
        clone.command("bash", "-euc", back)
        assert clone.lock() == before
        assert "up to date" in clone.dvc("status", "dvc.yaml")
        clone.command("bash", "-euc", remote.replace("ssh://HOST/PATH", str(tmp_path)))
        clone.command("bash", "-euc", push)
        assert list(tmp_path.iterdir())

    def test_bad_parameters_stop_a_stage_before_it_computes(self, clone: Clone) -> None:
        file = clone.folder / "params.yaml"
        good = file.read_text()
        file.write_text(good.replace("max_length: 2", "max_length: two"))
        try:
            done = clone.run("stages/enumerate_sequences.py")
        finally:
            file.write_text(good)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "params.yaml: enumerate_sequences.max_length" in done.stderr

    def test_a_missing_input_names_the_stage_that_makes_it(self, clone: Clone) -> None:
        (clone.folder / "data" / "scenes" / "training.json").unlink()
        done = clone.run("stages/build_dataset.py")
        assert done.returncode == 2
        assert "generate_scenes" in done.stderr
