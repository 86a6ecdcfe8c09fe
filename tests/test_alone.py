"""Two runs of one stage in one clone."""

import subprocess
import sys
from pathlib import Path

import pytest

from guided_lgp.cli import alone as module
from guided_lgp.cli.alone import alone
from guided_lgp.errors import InputError

HOLDER = """
import sys
from pathlib import Path
from guided_lgp.cli.alone import alone
with alone(Path(sys.argv[1]), "train_policy@place"):
    print("running", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    (tmp_path / ".dvc").mkdir()
    return tmp_path


def holder(clone: Path) -> subprocess.Popen[str]:
    """A process that runs a stage until its standard input ends."""
    command = [sys.executable, "-c", HOLDER, str(clone)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "running\n"
    return process


def test_the_second_is_refused_and_the_first_is_named(
    clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 0.3)
    first = holder(clone)
    fault = f"train_policy@place: runs already in this clone: process {first.pid} on "
    with pytest.raises(InputError, match=fault), alone(clone, "train_policy@place"):
        pass
    with alone(clone, "train_policy@grasp"):  # another stage
        pass
    first.kill()
    first.wait()
    with alone(clone, "train_policy@place"):
        pass


def test_the_second_waits_for_one_that_is_about_to_end(clone: Path) -> None:
    first = holder(clone)
    assert first.stdin is not None
    end = subprocess.Popen(["sh", "-c", f"sleep 0.5; kill {first.pid}"])
    with alone(clone, "train_policy@place"):
        assert first.wait(5) != 0
    end.wait()


def test_a_planted_link_is_not_followed(clone: Path) -> None:
    victim = clone / "victim"
    victim.write_text("mine")
    lock = clone / ".dvc" / "tmp" / "guided-lgp" / "stage.lock"
    lock.parent.mkdir(parents=True)
    lock.symlink_to(victim)
    with pytest.raises(InputError, match=r"stage\.lock: cannot be locked"), alone(clone, "stage"):
        pass
    assert victim.read_text() == "mine"


def test_outside_a_clone_there_is_no_lock(tmp_path: Path) -> None:
    with alone(tmp_path, "stage"), alone(tmp_path, "stage"):
        assert list(tmp_path.iterdir()) == []


STUDY = """
import runpy, sys
from guided_lgp.cli import alone
alone.PATIENCE_S = 0.3
del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_a_study_runs_once_at_a_time(clone: Path) -> None:
    file = Path(__file__).parents[1] / "studies" / "run.py"
    command = [sys.executable, "-c", STUDY, str(file), "render"]
    with alone(clone, "studies render"):
        done = subprocess.run(command, cwd=clone, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: studies render: runs already in this clone: process")
