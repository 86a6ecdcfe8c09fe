"""README and docs: the commands they name exist, links lead somewhere, the worked example runs."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from dvc.cli.parser import get_main_parser
from typer.main import get_command

from guided_lgp import cli
from guided_lgp.cli import STAGES
from guided_lgp.params import load_params
from guided_lgp.tracking import flatten

ROOT = Path(__file__).parents[2]
PARAMS = load_params(ROOT / "params.yaml")
EXTENDING = ROOT / "docs" / "extending.md"
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_options_exist(page: Path) -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    group = get_command(cli.app)
    assert hasattr(group, "commands")
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").replace("&&", "\n").splitlines():
            words = line.split("#")[0].split()
            if words[:1] == ["make"]:
                assert words[1] in targets, line
            if words[:1] == ["guided-lgp"] and not words[1].startswith("-"):
                command = group.commands[words[1]]
                options = {
                    name
                    for parameter in command.params
                    for name in (*parameter.opts, *parameter.secondary_opts)
                }
                used = {word.split("=")[0] for word in words[2:] if word.startswith("--")}
                assert used <= options, line
            if words[:1] == ["python"]:
                assert (ROOT / words[1]).is_file(), line
            if words[:1] == ["dvc"]:
                check_dvc(words[1:])


def check_dvc(words: list[str]) -> None:
    """The command is one that DVC knows, on parameters and files that there are."""
    arguments = get_main_parser().parse_args(words)
    for change in getattr(arguments, "set_param", None) or []:
        name, _, _ = change.partition("=")
        assert name in flatten(PARAMS.model_dump()), change
    for target in getattr(arguments, "targets", None) or []:
        assert (ROOT / target).exists() or target in STAGES, target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_named_sources_exist(page: Path, rendered: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
    links = re.findall(r"\]\(([^)#]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    for link in links:
        if "://" not in link and not link.startswith("schemas/"):  # written with the site
            assert (page.parent / link).exists() or (rendered / link).exists(), link
    for name in re.findall(r"`((?:src/|tests/|stages/|examples/|benchmarks/)[\w/.]+)`", text):
        assert (ROOT / name).exists(), name
    modules = r"`((?:logic|scene|bounds|search|policy|experiments|report)/[\w/]+(?:\.py)?)`"
    for name in re.findall(modules, text):
        assert (ROOT / "src/guided_lgp" / name).exists(), name


def run_script(script: str, sources: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run an example on the sources of a folder, or on those that are installed."""
    environment = os.environ | ({} if sources is None else {"PYTHONPATH": str(sources)})
    return subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def section(heading: str) -> list[str]:
    """The blocks of Python in a section of the page on extending."""
    text = EXTENDING.read_text(encoding="utf-8").partition(f"## {heading}")[2].partition("\n## ")[0]
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def copied_sources(folder: Path, declaration: str) -> Path:
    """The sources with one file more, whose name is in its first line; the sources' package."""
    shutil.copytree(ROOT / "src/guided_lgp", folder / "src/guided_lgp")
    file = folder / declaration.splitlines()[0].removeprefix("# ")
    file.parent.mkdir(exist_ok=True)
    file.write_text(declaration, encoding="utf-8")
    return folder / "src/guided_lgp"


def test_the_example_robot_is_one_file(tmp_path: Path) -> None:
    (robot,) = blocks(EXTENDING, "yaml")
    (script,) = section("Another robot")
    file = tmp_path / robot.splitlines()[0].removeprefix("# ")
    file.write_text(robot, encoding="utf-8")
    done = run_script(script.replace(file.name, str(file)))
    assert done.returncode == 0, done.stderr
    assert done.stdout == "(grasp ur3 red) (place ur3 red tab2)\n"


def test_the_example_planner_is_one_file_and_its_rows(tmp_path: Path) -> None:
    declaration, entry, row, script = section("Another planner")
    package = copied_sources(tmp_path, declaration)
    registry = package / "search" / "planners.py"
    text = registry.read_text(encoding="utf-8")
    for begin, line in (
        ("SEARCHES: Mapping[str, Search] = {\n", entry),
        ("    for planner in (\n", f"{row.strip()},\n"),
    ):
        assert begin in text
        text = text.replace(begin, begin + line)
    registry.write_text(text, encoding="utf-8")
    done = run_script(script, tmp_path / "src")
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"Weighted A\* \(grasp \S+ red\) \(place \S+ red green\)\n", done.stdout)


def test_the_example_domain_is_one_file(tmp_path: Path) -> None:
    declaration, script = section("Another instruction, another goal: a domain")
    copied_sources(tmp_path, declaration)
    done = run_script(script, tmp_path / "src")
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"\(unstack \S+ red tab1\) \(place \S+ red green\)\n", done.stdout)
    unchanged = run_script(script)
    assert "unknown 'blocks' (accepted: handover, pick_and_place)" in unchanged.stderr


def test_the_example_policy_is_one_package(tmp_path: Path) -> None:
    declaration, script = section("Another policy")
    copied_sources(tmp_path, declaration)
    done = run_script(script, tmp_path / "src")
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"\(grasp \S+ red\) \(place \S+ red green\)\n", done.stdout)
    unchanged = run_script(script)
    assert "policy 'goals_first': is unknown" in unchanged.stderr
