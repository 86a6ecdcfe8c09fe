"""What the program must never do: unpickle files, run text as code or in a shell, let a name act in
a page, serve the network. Sources are searched for it, and what runs is watched.
"""

import ast
import os
import pickle
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import psutil
import pytest

from guided_lgp import cli, parallel, tracking
from guided_lgp.bounds.results import Trajectory
from guided_lgp.errors import InputError
from guided_lgp.policy.paper.dataset import load_dataset
from guided_lgp.robots import load_robot
from guided_lgp.scene import Scene, load_scene
from guided_lgp.view.replay import replay_html
from guided_lgp.view.viewer import Viewer

ROOT = Path(__file__).parents[1]
SOURCES = sorted(
    file for folder in ("src", "stages", "benchmarks") for file in (ROOT / folder).rglob("*.py")
)
FORBIDDEN_MODULES = {"pickle", "cPickle", "cloudpickle", "dill", "shelve", "marshal"}
FORBIDDEN_CALLS = {
    *("__import__", "compile"),
    *("eval", "exec", "os.system", "os.popen", "joblib.load", "joblib.dump", "torch.load"),
    *("torch.save", "read_pickle", "to_pickle", "yaml.load", "yaml.unsafe_load", "yaml.full_load"),
    *("subprocess.getoutput", "subprocess.getstatusoutput", "load_from_checkpoint"),
}
FORBIDDEN_ARGUMENTS = {("allow_pickle", True), ("shell", True), ("host", "0.0.0.0")}


def faults(source: str) -> Iterator[str]:
    """What a source file must not have, with its line."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Import():
                modules = [alias.name for alias in node.names]
            case ast.ImportFrom():
                modules = [node.module or ""]
            case _:
                modules = []
        for module in modules:
            if module.split(".")[0] in FORBIDDEN_MODULES:
                yield f"{node.lineno}: import of {module}"
        if isinstance(node, ast.Constant) and node.value == "0.0.0.0":
            yield f"{node.lineno}: 0.0.0.0"
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        if called == "re.compile":  # of patterns, not of programs
            continue
        if any(called == name or called.endswith(f".{name}") for name in FORBIDDEN_CALLS):
            yield f"{node.lineno}: call of {called}"
        for keyword in node.keywords:
            if (keyword.arg, getattr(keyword.value, "value", None)) in FORBIDDEN_ARGUMENTS:
                yield f"{node.lineno}: {ast.unparse(keyword)}"


def test_sources_neither_unpickle_nor_run_text() -> None:
    assert len(SOURCES) > 100
    found = [
        f"{file.relative_to(ROOT)}:{fault}"
        for file in SOURCES
        for fault in faults(file.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "import pickle",
        "from cloudpickle import loads",
        "np.load(file, allow_pickle=True)",
        "torch.load(file)",
        "joblib.load(file)",
        "pd.read_pickle(file)",
        "yaml.load(text, yaml.Loader)",
        "subprocess.run(line, shell=True)",
        "os.system(line)",
        "eval(text)",
        'serve(host="0.0.0.0")',
    ],
)
def test_the_search_finds(line: str) -> None:
    assert list(faults(line))


def test_templates_escape_everything() -> None:
    templates = list((ROOT / "src" / "guided_lgp").rglob("*.html.j2"))
    assert templates
    for template in templates:
        text = template.read_text(encoding="utf-8")
        assert "|safe" not in text.replace(" ", "")
        assert "autoescape" not in text


class Payload:
    """Leaves a file when it is unpickled."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.file),)


def test_a_pickle_in_a_data_set_is_not_run(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    folder = tmp_path / "dataset"
    folder.mkdir()
    (folder / "samples.safetensors").write_bytes(pickle.dumps(Payload(mark)))
    with pytest.raises(InputError):
        load_dataset(folder)
    assert not mark.exists()


WATCHED = """
import sys
from pathlib import Path
from guided_lgp import planning
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.params import load_params
from guided_lgp.robots import load_robot
from guided_lgp.scene import load_scene

scene, params = load_scene(Path("examples/three_boxes.json")), load_params()
SceneBounds(scene, params.bounds)
watched = "pickle.find_class", "os.system", "os.exec", "subprocess.Popen"
sys.addaudithook(lambda event, arguments: event in watched and print(event, arguments))
assert planning.plan(scene, "(on red green)", params=params).solved
"""


def test_planning_loads_no_pickle_and_starts_no_process() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WATCHED], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


class Elements(HTMLParser):
    """Counts the elements of a page."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.found: Counter[str] = Counter()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found[tag] += 1


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(ROOT / "examples" / "three_boxes.json")


def test_a_name_of_a_scene_cannot_act_in_a_page(scene: Scene, tmp_path: Path) -> None:
    q = np.tile(load_robot("pr2").home, (2, 1))
    motion = Trajectory(load_robot("pr2").joint_names, np.arange(2.0), q, ())
    found = []
    for name in ("scene", "</title><script>alert(1)</script><img src=x onerror=alert(1)>"):
        file = tmp_path / "page.html"
        replay_html(motion, scene.model_copy(update={"name": name}), file)
        found.append(Elements(file).found)
    assert found[0] == found[1]
    assert found[0]["script"] > 0


def listening(process: psutil.Process) -> set[str]:
    """The addresses that a process and those below it serve."""
    whole = [process, *process.children(recursive=True)]
    return {
        connection.laddr.ip
        for part in whole
        for connection in part.net_connections("inet")
        if connection.status == psutil.CONN_LISTEN
    }


def test_servers_listen_on_the_loopback_interface(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Viewer(scene):
        assert listening(psutil.Process()) == {"127.0.0.1"}

    monkeypatch.delenv(parallel.SCHEDULER_VARIABLE, raising=False)
    with parallel._dask_client(1):
        assert listening(psutil.Process()) == {"127.0.0.1"}

    commands: list[list[str]] = []
    monkeypatch.setattr(tracking, "prepare", Mock())
    monkeypatch.setattr(os, "execv", lambda program, command: commands.append(command))
    with pytest.raises(SystemExit):
        cli.main(["mlflow", "ui", "--port", "5001"])
    (command,) = commands
    assert command[command.index("--host") + 1] == "127.0.0.1"
