"""The wheel, in an environment with nothing but what it declares: planning from an empty folder."""

import ast
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import venv
from collections.abc import Sequence
from importlib.metadata import Distribution
from pathlib import Path

import pytest
import tomllib
import yaml
from packaging.requirements import Requirement

from guided_lgp import __version__
from guided_lgp.params import PlanningParams, load_params, load_planning
from guided_lgp.paths import MODELS, PLANNING
from guided_lgp.ship import CARD, ship

ROOT = Path(__file__).parents[1]
PIPELINE_ONLY = ("torch", "lightning", "mlflow", "dvc", "pandas", "pyarrow", "joblib", "matplotlib")
LIMIT = 1.2e9
"""Bytes of the core's packages, of which PyBullet, CasADi and Boost are more than half."""


def needed(name: str, *extras: str, path: Sequence[str] = sys.path) -> dict[str, Distribution]:
    """A distribution and all that it requires, with some of its extras, by name."""
    found: dict[str, Distribution] = {}
    waiting = [(name, {"", *extras})]
    while waiting:
        name, wanted = waiting.pop()
        package = next(iter(Distribution.discover(name=name, path=list(path))))
        found[package.name] = package
        for requirement in map(Requirement, package.requires or []):
            marker = requirement.marker
            chosen = marker is None or any(marker.evaluate({"extra": extra}) for extra in wanted)
            if chosen and (requirement.name not in found or requirement.extras):
                waiting.append((requirement.name, {"", *requirement.extras}))
    return found


def top_level(package: Distribution) -> set[Path]:
    """Files and folders that a distribution puts into site-packages."""
    names = {file.parts[0] for file in package.files or [] if ".." not in file.parts}
    return {Path(str(package.locate_file(name))) for name in names if name != "__pycache__"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    sources = folder / "sources"
    shutil.copytree(
        ROOT / "src", sources / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info")
    )
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, sources]
    subprocess.run(command, check=True, timeout=300)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel and links to what it requires, with the extra for looking; nothing else."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    (site,) = folder.glob("lib/python*/site-packages")
    words = ["install", "-q", "--no-deps", "--prefix", str(folder), str(wheel)]
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", str(folder / "bin/python"), *words],
        check=True,
        timeout=300,
    )
    for package in needed("guided-lgp", "view", path=[str(site), *sys.path]).values():
        for entry in top_level(package):
            if not (site / entry.name).exists():
                (site / entry.name).symlink_to(entry)
    return folder


def site(environment: Path) -> list[str]:
    """Where the wheel's own metadata are."""
    return [str(folder) for folder in environment.glob("lib/python*/site-packages")]


def run(environment: Path, *words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [str(environment / "bin" / words[0]), *words[1:]]
    return subprocess.run(
        command, cwd=cwd, text=True, capture_output=True, check=False, timeout=300
    )


def viewed(environment: Path, file: str, folder: Path) -> str:
    """What the viewer prints before it is interrupted; it must end well."""
    with subprocess.Popen(
        [environment / "bin" / "guided-lgp", "view", file],
        cwd=folder,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
        text=True,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    return line


def test_the_wheel_plans_views_and_writes_a_page_from_an_empty_folder(
    environment: Path, tmp_path: Path
) -> None:
    for package in PIPELINE_ONLY:
        absent = run(environment, "python", "-c", f"import {package}", cwd=tmp_path)
        assert "ModuleNotFoundError" in absent.stderr, package
    copied = run(environment, "guided-lgp", "examples", cwd=tmp_path)
    assert "examples/three_boxes.json" in copied.stdout
    goals = ["--goal", "(on red green)", "--goal", "(held blue)"]
    files = ["--out", "plan.json", "--html", "plan.html"]
    words = ["guided-lgp", "plan", "examples/three_boxes.json", *goals, *files, "--execute"]
    planned = run(environment, *words, cwd=tmp_path)
    assert planned.returncode == 0, planned.stderr
    assert "physics: all goals hold" in planned.stdout
    assert "weights shipped with" in planned.stdout
    assert json.loads((tmp_path / "plan.json").read_text())["actions"]
    assert "<script" in (tmp_path / "plan.html").read_text()
    assert viewed(environment, "plan.json", tmp_path).startswith("http://127.0.0.1:")
    exported = run(environment, "guided-lgp", "export", "plan.json", "motion.csv", cwd=tmp_path)
    assert exported.stdout == "written: motion.csv\n"
    assert "error" not in run(environment, "guided-lgp", "doctor", cwd=tmp_path).stderr


def test_a_stage_without_its_packages_names_the_extra(environment: Path, tmp_path: Path) -> None:
    shutil.copy(ROOT / "params.yaml", tmp_path)
    refused = run(environment, "guided-lgp", "build_dataset", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "pip install 'guided-lgp[pipeline]'" in refused.stderr


def test_the_core_is_small(environment: Path) -> None:
    packages = needed("guided-lgp", path=[*site(environment), *sys.path]).values()
    files = {Path(str(file.locate())) for package in packages for file in package.files or []}
    assert sum(file.stat().st_size for file in files if file.is_file()) < LIMIT


def test_planning_imports_neither_training_nor_tables_nor_plots() -> None:
    code = "import sys, guided_lgp.planning, guided_lgp.cli; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], text=True, capture_output=True, check=True
    )
    assert set(PIPELINE_ONLY).isdisjoint(loaded.stdout.split())


def test_shipped_limits_are_those_of_the_pipeline() -> None:
    params = load_params(ROOT / "params.yaml")
    assert load_planning().model_dump() == params.model_dump(
        include=set(PlanningParams.model_fields)
    )
    assert load_planning(ROOT / "params.yaml") == params


def test_ship_takes_the_weights_and_limits_of_a_clone(tmp_path: Path) -> None:
    clone = tmp_path / "clone"
    shutil.copytree(ROOT / "models", clone / "models")
    shutil.copytree(ROOT / "reports/metrics", clone / "reports/metrics")
    (clone / "models" / "relational.json").write_text("{}")
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    params["bounds"]["coarse_restarts"] = 5
    (clone / "params.yaml").write_text(yaml.safe_dump(params))
    ship(clone, tmp_path / "models", tmp_path / "planning.yaml")
    assert (tmp_path / "models" / "relational.json").read_text() == "{}"
    assert {f.name for f in (tmp_path / "models").iterdir()} == {f.name for f in MODELS.iterdir()}
    assert load_planning(tmp_path / "planning.yaml").bounds.coarse_restarts == 5
    assert load_planning(PLANNING).bounds.coarse_restarts != 5
    assert f"{params['generate_scenes']['training_configurations']} random scenes" in (
        (tmp_path / "models" / CARD).read_text()
    )


def test_the_lock_pins_every_file(environment: Path) -> None:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    assert len(lines) > 100
    for line in lines:
        assert re.fullmatch(r"[\w.-]+==[\w.+!-]+ --hash=sha256:[0-9a-f]{64}", line), line
    locked = {re.sub(r"[-_.]+", "-", line.partition("==")[0]).lower() for line in lines}
    required = needed("guided-lgp", "test", "lint", path=[*site(environment), *sys.path]).keys() - {
        "guided-lgp",
        "torch",
    }
    assert {re.sub(r"[-_.]+", "-", name).lower() for name in required} <= locked
    assert (ROOT / "requirements-torch.lock").read_text().startswith("torch==")


def test_the_sources_use_nothing_newer_than_the_oldest_python() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == ">=3.10,<3.14"
    newer = {
        "Self",
        "StrEnum",
        "LiteralString",
        "Never",
        "assert_never",
        "UTC",
        "chdir",
        "override",
    }
    for file in (ROOT / "src").rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 10))
        imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
        names = {alias.name for node in imports for alias in node.names}
        assert names.isdisjoint(newer | {"tomllib"}), file


def test_every_extra_is_explained() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    for extra in project["optional-dependencies"].keys() - {"test", "lint"}:
        assert f"| `{extra}` |" in page, extra


def test_the_release_is_the_same_everywhere(wheel: Path) -> None:
    heading = r"^## \[(\S+)\] - (\d{4}-\d\d-\d\d)$"
    changelog = (ROOT / "CHANGELOG.md").read_text()
    newest, date = re.findall(heading, changelog, flags=re.MULTILINE)[0]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert newest == __version__ == citation["version"] == wheel.name.split("-")[1]
    assert date == str(citation["date-released"])
    for page in (ROOT / "README.md", ROOT / "docs/tutorial.md"):
        assert f"weights shipped with {__version__}" in page.read_text(encoding="utf-8")


def test_continuous_integration_runs_what_anyone_can_run() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())
    assert workflow["jobs"]["test"]["steps"][-1]["run"] == ".ci/run"
    installed = [step.get("run") for step in workflow["jobs"]["install"]["steps"]]
    command = "pip install '.[view]'"
    assert command in installed
    for page in (ROOT / "README.md", ROOT / "docs/index.md"):
        assert f"```sh\n{command}\n```" in page.read_text(encoding="utf-8")
    for form in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"):
        assert {"name", "description", "body"} <= yaml.safe_load(form.read_text()).keys()


def test_no_module_has_more_than_400_lines() -> None:
    sources = (ROOT / "src").rglob("*.py")
    assert {file for file in sources if len(file.read_text().splitlines()) > 400} == set()
