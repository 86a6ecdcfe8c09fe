"""``--timeout`` of what computes: one line, code 1, nobody left at work."""

import signal
import time
from contextlib import nullcontext
from pathlib import Path
from threading import Thread

import psutil
import pytest

from guided_lgp import cli, parallel, tracking
from guided_lgp.cli import within
from guided_lgp.experiments import train_relational
from guided_lgp.params import Parallel

PARAMS = Path(__file__).with_name("params.yaml")


def busy(folder: Path) -> None:
    """Leave a file named by the process, then compute for a minute."""
    (folder / str(psutil.Process().pid)).touch()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        pass


def ring(folder: Path, workers: int) -> None:
    """Bring the end of the time forward to when all workers are at work."""
    while len(list(folder.iterdir())) < workers:
        time.sleep(0.1)
    signal.setitimer(signal.ITIMER_REAL, 0.1)


def test_a_stage_ends_with_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tracking, "recorded", lambda *_: nullcontext())
    monkeypatch.setattr(train_relational, "run", lambda *_: time.sleep(60))
    start = time.monotonic()
    with pytest.raises(SystemExit, match=r"train_relational: not finished after 0\.2 s"):
        cli.main(["train_relational", "--params", str(PARAMS), "--timeout", "0.2"])
    assert time.monotonic() - start < 20


@pytest.mark.parametrize("workers", [1, 2])
def test_workers_end_with_it(workers: int, tmp_path: Path) -> None:
    settings = Parallel(backend="loky", workers=workers)
    ringing = Thread(target=ring, args=(tmp_path, workers))
    ringing.start()
    with pytest.raises(SystemExit, match="it: not finished after"), within(50, "it"):
        parallel.run(busy, [tmp_path] * 2, settings, "busy")
    ringing.join()
    started = {int(file.name) for file in tmp_path.iterdir()}
    assert len(started) == workers
    started -= {psutil.Process().pid}
    end = time.monotonic() + 20
    while any(map(psutil.pid_exists, started)) and time.monotonic() < end:
        time.sleep(0.1)
    assert not any(map(psutil.pid_exists, started))


def test_what_is_in_time_goes_on() -> None:
    with within(0.2, "it"):
        pass
    with within(None, "it"):
        time.sleep(0.3)


@pytest.mark.parametrize("word", ["0", "-1", "nan", "inf", "1e9", "ten", ""])
def test_no_number_of_seconds(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["generate_scenes"], ["plan", "scene.json", "--goal", "(held red)"]):
        with pytest.raises(SystemExit) as caught:
            cli.main([*words, f"--timeout={word}"])
        assert caught.value.code == 2
        assert "is no number of seconds" in capsys.readouterr().err
