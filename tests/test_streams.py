"""The three streams of a program: unread, closed, full."""

import errno
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from guided_lgp import cli
from guided_lgp.bounds.plan_file import read_plan

ROOT = Path(__file__).parents[1]
SCENE = ROOT / "examples" / "three_boxes.json"
PLAN = ["plan", str(SCENE), "--goal", "(on red green)", "--planner", "breadth-first"]


@pytest.mark.parametrize("command", [["schema", "params"], [*PLAN, "--html", "-"]])
def test_a_closed_pipe_is_no_error(command: list[str]) -> None:
    words = f"{sys.executable} -m guided_lgp.cli {shlex.join(command)} | head -c 20"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", words],
        cwd=ROOT,
        text=True,
        capture_output=True,
        check=True,
    )
    assert done.stderr == ""
    assert len(done.stdout) == 20


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["schema", "params"], 0),
        (["plan", str(SCENE), "--goal", "(on red none)"], 2),
        (["plan", str(SCENE), "--goal", "(held red)", "--max-nodes", "1"], 1),
    ],
)
def test_the_code_is_the_same_where_nobody_reads(words: list[str], code: int) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "guided_lgp.cli", *words]
    ended = subprocess.run(command, cwd=ROOT, stdout=writer, stderr=writer, check=False)
    os.close(writer)
    assert ended.returncode == code


def test_streams_that_are_closed_get_no_file_in_their_place(tmp_path: Path) -> None:
    plans = [tmp_path / "ordinary.json", tmp_path / "closed.json"]
    for plan, closed in zip(plans, ("", "<&- >&- 2>&-"), strict=True):
        words = shlex.join([sys.executable, "-m", "guided_lgp.cli", *PLAN, "--out", str(plan)])
        subprocess.run(["bash", "-c", f"{words} {closed}"], cwd=ROOT, check=True)
    found = [read_plan(plan) for plan in plans]
    assert found[0].actions == found[1].actions


@pytest.mark.parametrize("command", ["plan", "view"])
def test_a_pipe_is_read_once(command: str, tmp_path: Path) -> None:
    """The second time, nobody would write."""
    options = {"plan": "--goal '(on red green)' --planner breadth-first", "view": "--rerun a.rrd"}
    program = shlex.join([sys.executable, "-m", "guided_lgp.cli", command])
    words = f"{program} <(cat {shlex.quote(str(SCENE))}) {options[command]}"
    done = subprocess.run(
        ["bash", "-c", words], cwd=tmp_path, text=True, capture_output=True, check=False
    )
    fault = done.stderr.partition(": ")[2].partition(": ")[2]
    assert (done.returncode, fault) in (
        (0, ""),
        (2, "has no motion to record (accepted: a plan written by plan --out)\n"),
    )


@pytest.mark.parametrize(
    ("number", "line"),
    [
        (errno.ENOSPC, "output: cannot be written: No space left on device"),
        (errno.ENAMETOOLONG, "output: File name too long (accepted: a file)"),
    ],
)
def test_what_a_user_can_mend_is_one_line(
    number: int, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("guided_lgp.schemas.schema", fail)
    with pytest.raises(SystemExit) as ended:
        cli.main(["schema", "params"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"error: {line}\n"
