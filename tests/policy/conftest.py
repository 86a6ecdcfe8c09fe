import pytest
from synthetic import Enumeration, enumerate_world

from guided_lgp.domains import load_domain
from guided_lgp.logic import Symbols


@pytest.fixture(scope="session")
def world(tmp_path_factory: pytest.TempPathFactory) -> Enumeration:
    return enumerate_world(tmp_path_factory.mktemp("world"), configurations=5, seed=7)


@pytest.fixture
def symbols() -> Symbols:
    return load_domain().symbols(
        gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2")
    )
