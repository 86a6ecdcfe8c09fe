"""Every declared policy can be read and asked, by what planning has installed."""

import subprocess
import sys

import pytest

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.paths import MODELS
from guided_lgp.policy.registry import (
    POLICIES,
    TRAINED_POLICIES,
    load_policy,
    missing_instructions,
)

PROGRAM = """
import sys


class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("torch", "lightning", "pandas", "pyarrow", "mlflow", "dvc"):
            raise ImportError(f"{name} is not installed")


sys.meta_path.insert(0, Absent())

from guided_lgp.logic import applicable_actions, parse_objective
from guided_lgp.paths import EXAMPLES
from guided_lgp.planning import plan
from guided_lgp.policy.registry import POLICIES, load_policy
from guided_lgp.scene import load_scene
from guided_lgp.search.observation import observe, start

scene = load_scene(EXAMPLES / "three_boxes.json")
actions = list(applicable_actions(scene.state, scene.symbols))
positions = observe(scene, start(scene))
for name in POLICIES:
    objective = parse_objective(["(on red green)"])
    scores = load_policy(name).log_probabilities(
        objective, scene.state, scene.symbols, positions, actions
    )
    assert len(scores) == len(actions), name
"""


def test_planning_and_policies_need_neither_torch_nor_tables() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", POLICIES)
def test_every_policy_says_which_instructions_it_can_score(name: str) -> None:
    declared = POLICIES[name]
    assert declared.name == name
    assert declared.label
    assert declared.summary
    assert declared.color.startswith("#")
    known = missing_instructions(load_policy(name, MODELS), load_domain("handover"))
    assert known == (("take",) if name in TRAINED_POLICIES else ())


def test_an_unknown_policy_is_one_line() -> None:
    with pytest.raises(InputError, match=f"policy 'other': is unknown .*{', '.join(POLICIES)}"):
        load_policy("other")
