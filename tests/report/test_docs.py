"""README and docs: the commands they name exist, links lead somewhere, the worked example runs."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from guided_lgp import cli

ROOT = Path(__file__).parents[2]
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
        for line in block.replace("\\\n", " ").splitlines():
            words = line.split("#")[0].split()
            if words[:1] == ["make"]:
                assert words[1] in targets, line
            if words[:1] == ["guided-lgp"] and not words[1].startswith("-"):
                command = group.commands[words[1]]
                options = {name for parameter in command.params for name in parameter.opts}
                used = {word.split("=")[0] for word in words[2:] if word.startswith("--")}
                assert used <= options, line
            if words[:1] == ["python"]:
                assert (ROOT / words[1]).is_file(), line


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


def test_the_worked_example_runs_on_the_changed_sources(tmp_path: Path) -> None:
    page = ROOT / "docs/extending.md"
    shutil.copytree(ROOT / "src/guided_lgp", tmp_path / "src/guided_lgp")
    for block in blocks(page, "diff"):
        heading, changes = block.split("\n", 1)
        file = tmp_path / heading.removeprefix("--- ")
        text = file.read_text(encoding="utf-8")
        for hunk in changes.split("@@\n"):
            lines = hunk.splitlines(keepends=True)
            before = "".join(line[1:] for line in lines if line[0] in " -")
            after = "".join(line[1:] for line in lines if line[0] in " +")
            assert text.count(before) == 1, f"{heading}:\n{hunk}"
            text = text.replace(before, after)
        file.write_text(text, encoding="utf-8")
    (script,) = blocks(page, "python")
    command = [sys.executable, "-c", script]
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "src")}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    unchanged = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert "is not an action" in unchanged.stderr
