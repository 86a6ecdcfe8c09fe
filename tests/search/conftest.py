"""Scenes and limits for the tests of the planners."""

import pytest
from scripted import make_scene

from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene


@pytest.fixture
def scene() -> Scene:
    """Setup a: three boxes on tab1."""
    return make_scene(3, tray=False)


@pytest.fixture
def tray_scene() -> Scene:
    """Setup b: three boxes on tab1, and the tray."""
    return make_scene(3, tray=True)


@pytest.fixture
def limits() -> SearchLimits:
    """Those of the generalization experiment."""
    return SearchLimits(
        max_depth=8, reattempts=3, max_tree_size=20_000, max_paths=1000, max_sequences=1000
    )
