"""A full disk and too little memory: one line, the old file whole, and nothing half-written."""

import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from guided_lgp.errors import LONGEST, InputError
from hostility.examples import ROOT
from hostility.figures import Counted
from hostility.kills import Writer, contents

DISK = 512 * 1024
"""Bytes of the small disk."""
MEMORY_MB = (150, 200, 500, 600, 1000, 2000)
"""Address space of a plan: too little to import it, and enough. In between, at 300 to 450, the
libraries themselves end the process while they are loaded."""
SCENE = ROOT / "examples" / "three_boxes.json"


@dataclass
class Figures(Counted):
    """Attempts under a limit, those that tore a file, and those that ended in other words."""

    tried: int = 0
    torn: int = 0
    foreign: int = 0


@contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """A disk of its own in a folder, if one can be mounted; else files cannot get longer."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(folder)]
    mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    try:
        yield
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def fill_up(folder: Path, left: int) -> None:
    """Leave so many bytes on the disk of a folder, or so long files where it is a large one."""
    if shutil.disk_usage(folder).total <= 2 * DISK:
        with suppress(OSError), (folder / "ballast").open("wb") as stream:
            while shutil.disk_usage(folder).free > left:
                stream.write(b"\0" * 1024)
                stream.flush()
    else:
        resource.setrlimit(resource.RLIMIT_FSIZE, (left, left))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)


def write_on_full_disks(writers: Sequence[Writer], folder: Path, figures: Figures) -> None:
    """Every writer over its older version, with nothing, little and a bit more left."""
    for writer in writers:
        for left in (0, 700, 9000):
            place = folder / f"{writer.name}-{left}".replace(" ", "-")
            place.mkdir(parents=True)
            with small_disk(place):
                _write_on_a_full_disk(writer, place, left, figures)


def _write_on_a_full_disk(writer: Writer, place: Path, left: int, figures: Figures) -> None:
    try:
        writer.work(place, 0)
    except (InputError, OSError):  # the small disk is too small for it
        return
    before = contents(place)

    def work() -> None:
        fill_up(place, left)
        writer.work(place, 1)

    figures.tried += 1
    outcome = in_child(work)
    after = contents(place)
    after.pop("ballast", None)
    missing = before.keys() - after.keys()
    changed = [name for name in before.keys() & after.keys() if before[name] != after[name]]
    if missing or (changed and outcome != "done" and len(before) == 1):
        what = f"{writer.name}, {left} B left: lost {missing}, changed {changed}"
        figures.fault("torn", what)
    if outcome not in ("done", "refused"):
        figures.fault("foreign", f"{writer.name}, {left} B left: {outcome}")


def in_child(work: Callable[[], object]) -> str:
    """Work in a child process: ``done``, ``refused`` in one line, or what happened else."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)

    def run() -> None:
        try:
            work()
            sender.send("done")
        except InputError:
            sender.send("refused")
        except Exception as error:
            sender.send(f"{type(error).__name__}: {error}")

    child = context.Process(target=run)
    child.start()
    sender.close()
    with suppress(EOFError):
        outcome = str(receiver.recv())
        child.join()
        return outcome
    child.join()
    return f"died with {child.exitcode}"


PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]), int(sys.argv[1])))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
from guided_lgp.cli import main
main(sys.argv[2:])
"""


def plan_with_little_memory(folder: Path, figures: Figures) -> None:
    """Plan over an older plan; it ends with a plan or with one line, and the file stays whole."""
    folder.mkdir(parents=True)
    out = folder / "plan.json"
    for megabytes in MEMORY_MB:
        out.write_text("{}")
        words = ["plan", str(SCENE), "--goal", "(on red green)", "--out", str(out)]
        command = [sys.executable, "-c", PROGRAM, str(megabytes * 2**20), *words]
        done = subprocess.run(
            command,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        figures.tried += 1
        found = out.read_text()
        if found != "{}" and not found.endswith("}\n"):
            figures.fault("torn", f"{megabytes} MB: half a plan")
        lines = done.stderr.splitlines()
        if done.returncode != 0 and (
            done.returncode < 0 or len(lines) != 1 or len(lines[0]) > LONGEST + len("error: ")
        ):
            what = f"{megabytes} MB: {done.returncode}: {done.stderr[-500:]}"
            figures.fault("foreign", what)
