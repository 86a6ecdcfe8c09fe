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
    """A folder with made-up outputs of all stages, rendered."""
    root = tmp_path_factory.mktemp("rendered")
    outputs.write_outputs(root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(render, "SceneBounds", outputs.Bounds)
        render.run(params, root)
    return root
