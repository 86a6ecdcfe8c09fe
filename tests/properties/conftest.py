"""Profiles of the property-based tests, and a folder for the files they write."""

import json
import os
from datetime import timedelta
from pathlib import Path

import pytest
from bad_input import EXAMPLE
from hypothesis import HealthCheck, settings

from guided_lgp.scene import Scene, load_scene

_SHARED = {
    "deadline": timedelta(seconds=30),  # an answer that takes longer is a hang
    "suppress_health_check": [HealthCheck.too_slow],
    "print_blob": True,
}
settings.register_profile("ci", **_SHARED, derandomize=True, database=None)
_SLOWER = {"deadline": timedelta(minutes=5)}  # it runs beside other work
settings.register_profile("long", **_SHARED | _SLOWER, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("generated")


@pytest.fixture(scope="session")
def scene() -> Scene:
    return load_scene(EXAMPLE)


@pytest.fixture(scope="session")
def scene_document() -> dict[str, object]:
    document: dict[str, object] = json.loads(EXAMPLE.read_text(encoding="utf-8"))
    return document
