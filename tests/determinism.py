"""Same seed, same bytes, whatever the number of workers: the check of `make verify-determinism`.

Runs the small profile of the commit at HEAD in three fresh clones, with one worker, with two and on
a Dask cluster, and compares every file that it writes. Ends with 1 if any differs; the clones are
then kept.
"""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import yaml

ROOT = Path(__file__).parents[1]
OUTPUTS = ("data", "models", "reports")
TIMING = Path("reports/metrics/scalability_timing.json")
"""The one output that may differ: it holds measured times and memory."""
MEASURED = Path("reports/metrics/geometry.json")
"""What `make bench` measures: the report shows it, the pipeline does not write it."""


class Clone:
    """A clone of the repository with the small profile and without any results."""

    def __init__(self, folder: Path, workers: int, backend: str = "loky") -> None:
        self.folder = folder
        subprocess.run(["git", "clone", "-q", str(ROOT), str(folder)], check=True)
        params = yaml.safe_load((folder / "tests" / "params.yaml").read_text())
        params["parallel"] = {"backend": backend, "workers": workers}
        (folder / "params.yaml").write_text(yaml.safe_dump(params, sort_keys=False))
        (folder / "dvc.lock").unlink()
        for name in OUTPUTS:
            shutil.rmtree(folder / name, ignore_errors=True)
        self.run("git", "checkout", "--quiet", "--", str(MEASURED))

    def run(self, *command: str) -> None:
        """Run a command with the packages of this environment, but the sources of the clone."""
        subprocess.run(command, cwd=self.folder, env=self._environment(), check=True)

    def start(self, *command: str, log: Path) -> subprocess.Popen[bytes]:
        """Start a command in a process group of its own."""
        with log.open("wb") as stream:
            return subprocess.Popen(
                command,
                cwd=self.folder,
                env=self._environment(),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
            )

    def _environment(self) -> dict[str, str]:
        kept = {name: os.environ[name] for name in os.environ if not name.startswith("DVC_")}
        return kept | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(self.folder / "src"),
            "XDG_CACHE_HOME": str(self.folder / ".cache"),
            "MLFLOW_TRACKING_URI": f"sqlite:///{self.folder / 'mlflow.db'}",
        }

    def check_sources(self) -> None:
        """Make sure that the clone runs its own sources, not those that are installed."""
        package = self.folder / "src" / "guided_lgp" / "__init__.py"
        code = f"import guided_lgp as g; assert g.__file__ == {str(package)!r}, g.__file__"
        self.run("python", "-c", code)

    def repro(self) -> None:
        """Run the pipeline."""
        start = time.monotonic()
        self.run("dvc", "repro", "--quiet")
        print(f"{self.folder.name}: {time.monotonic() - start:.0f} s", flush=True)


def render_with_times_of(first: Path, second: Clone) -> None:
    """Give the second run the first one's times and render its reports again.

    The tables, the figure and the pages that show times can then be compared like all the rest.
    """
    shutil.copy(first / TIMING, second.folder / TIMING)
    second.run("dvc", "repro", "--quiet", "--single-item", "--force", "render_reports")


def outputs(folder: Path) -> set[Path]:
    """What a run has written, relative to its folder."""
    found = (file for name in OUTPUTS for file in (folder / name).rglob("*") if file.is_file())
    return {file.relative_to(folder) for file in found} - {TIMING}


def differences(first: Path, second: Path) -> Iterator[str]:
    """One line for each output that is not the same in both folders."""
    for file in sorted(outputs(first) | outputs(second)):
        contents = [
            path.read_bytes() if path.is_file() else None for path in (first / file, second / file)
        ]
        if None in contents:
            writer = second if contents[0] is None else first
            yield f"{file}: written in {writer.name} only"
        elif contents[0] != contents[1]:
            yield f"{file}: differs in {second.name}"


def main() -> int:
    """Run, compare, report."""
    parent = Path(mkdtemp(prefix="determinism-"))
    first = Clone(parent / "loky-1", 1)
    others = [Clone(parent / "loky-2", 2), Clone(parent / "dask-2", 2, "dask")]
    for clone in (first, *others):
        clone.check_sources()
        clone.repro()
    found = []
    for clone in others:
        render_with_times_of(first.folder, clone)
        found += differences(first.folder, clone.folder)
    for line in found:
        print(line)
    count = len(outputs(first.folder))
    print(f"{count} files of 3 runs compared (not {TIMING}), {len(found)} differences")
    if found:
        print(f"the clones are kept in {parent}")
        return 1
    shutil.rmtree(parent)
    return 0


if __name__ == "__main__":
    sys.exit(main())
