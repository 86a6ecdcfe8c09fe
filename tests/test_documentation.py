"""README and documentation: every command runs as written, the site builds without a warning."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import guided_lgp
from guided_lgp.cli import cases
from guided_lgp.cli.files import Format
from guided_lgp.schemas import SCHEMAS

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    page
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
    if re.search(r"^guided-lgp ", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
)
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
SERVER = "guided-lgp view"
"""A command that serves until it is interrupted."""
STAGES_OF_CASES = tuple(f"guided-lgp {one.name}" for one in cases.app.registered_commands)
ENVIRONMENT = os.environ | {
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
}


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Language and content of the code blocks."""
    text = page.read_text(encoding="utf-8")
    yield from re.findall(r"^```(\w+)\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def run(command: str, folder: Path) -> str:
    """What a command or script prints; it must succeed."""
    done = subprocess.run(
        ["bash", "-euc", command],
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}"
    return done.stdout


def serve(command: str, folder: Path) -> str:
    """What a server prints before it is interrupted; it must end well."""
    with subprocess.Popen(
        ["bash", "-euc", f"exec {command}"],
        cwd=folder,
        env=ENVIRONMENT | {"PYTHONUNBUFFERED": "1"},
        text=True,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(60) == 0
        finally:
            process.kill()  # where signals are ignored, it would be waited for without end
    return line


def without_figures(text: str) -> str:
    """The text with every decimal number replaced: times differ."""
    return re.sub(r"\d+\.\d+", "#", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_run_as_written(page: Path, tmp_path: Path) -> None:
    printed = ""
    for language, content in blocks(page):
        match language:
            case "json":
                (tmp_path / "scene.json").write_text(content)
            case "python":
                (tmp_path / "script.py").write_text(content)
                printed = run("python script.py", tmp_path)
            case "sh" if content.startswith(SERVER) and "--rerun" not in content:
                assert serve(content.strip(), tmp_path).startswith("http://127.0.0.1:")
            case "sh" if content.startswith(STAGES_OF_CASES):
                continue  # of a clone, for hours: its tests run them small
            case "sh" if content.startswith("guided-lgp "):
                printed = run(content, tmp_path)
            case "text":
                assert without_figures(printed) == without_figures(content)


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path)]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env=ENVIRONMENT | {"NO_MKDOCS_2_WARNING": "1"},
        text=True,
        capture_output=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    written = {file.name.split(".")[0] for file in (tmp_path / "schemas").iterdir()}
    assert written == set(SCHEMAS) == {name.value for name in Format}
    page = (tmp_path / "api" / "index.html").read_text(encoding="utf-8")
    documented = {address.rpartition(".")[2] for address in re.findall(r'id="([\w.]+)"', page)}
    assert set(guided_lgp.__all__) - {"Scene"} <= documented  # a Scene is the file that it is in


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebooks_run(notebook: Path, tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    shutil.copy(ROOT / "tests" / "params.yaml", tmp_path / "tests")
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    assert all(not cell.get("outputs") for cell in cells)
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    (tmp_path / "script.py").write_text("\n".join(code))
    run("python script.py", tmp_path)
