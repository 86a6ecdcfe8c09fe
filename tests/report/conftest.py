import fcntl
import os
from pathlib import Path

import outputs
import pytest

from guided_lgp.params import Params, load_params
from guided_lgp.report import render

SOURCES = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def params() -> Params:
    return load_params(SOURCES / "params.yaml")


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory, params: Params) -> Path:
    """A folder with made-up outputs of all stages, rendered; for all workers of a run."""
    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    root = folder / "rendered"
    with (folder / "rendered.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not root.exists():
            unfinished = tmp_path_factory.mktemp("unfinished")
            outputs.write_outputs(unfinished)
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(render, "SceneBounds", outputs.Bounds)
                render.run(params, unfinished)
            unfinished.rename(root)
    return root
