"""The paper's case, pinned: verdicts and configurations of seeded random skeletons.

`python tests/pins/test_paper_case.py` writes them anew, after a change that alters them on purpose.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Skeleton, applicable_actions, format_skeleton, successor
from guided_lgp.params import load_params
from guided_lgp.scene import Scene, generate

ROOT = Path(__file__).parents[2]
PINS = Path(__file__).with_name("paper_case.json")
SAMPLES = (("a", 2, 8), ("a", 4, 8), ("b", 4, 4), ("d", 8, 3), ("e6", 6, 2))
"""Setup, actions, and how many scenes, with one skeleton each."""
SEED = 991
TOLERANCE = 1e-6
"""m and rad: what another order of sums may change."""


def samples() -> Iterator[tuple[Scene, Skeleton]]:
    for setup, length, count in SAMPLES:
        for index, scene in enumerate(generate(setup, count, SEED, setup).scenes):
            rng = np.random.default_rng([SEED, length, index])
            state, skeleton = scene.state, ()
            for _ in range(length):
                actions = list(applicable_actions(state, scene.symbols))
                action = actions[rng.integers(len(actions))]
                skeleton, state = (*skeleton, action), successor(state, action)
            yield scene, skeleton


def outcome(scene: Scene, skeleton: Skeleton) -> dict[str, Any]:
    """Verdict and, where feasible, the configuration after the last action."""
    bounds = SceneBounds(scene, load_params(ROOT / "params.yaml").bounds)
    result = bounds.coarse(skeleton)
    row: dict[str, Any] = {"skeleton": format_skeleton(skeleton), "feasible": result.feasible}
    if result.feasible:
        last = result.after_action[-1]
        row["q"] = last.q.tolist()
        row["boxes"] = {name: pose.tolist() for name, pose in sorted(last.boxes.items())}
        row["path"] = bounds.path(skeleton).feasible
    return row


@pytest.mark.parametrize("number", range(sum(count for *_, count in SAMPLES)))
def test_verdict_and_configuration_are_as_pinned(number: int) -> None:
    pinned = json.loads(PINS.read_text())[number]
    row = outcome(*list(samples())[number])
    for key in ("skeleton", "feasible", "path"):
        assert row.get(key) == pinned.get(key)
    if pinned["feasible"]:
        np.testing.assert_allclose(row["q"], pinned["q"], atol=TOLERANCE, rtol=0)
        for name, pose in pinned["boxes"].items():
            np.testing.assert_allclose(row["boxes"][name], pose, atol=TOLERANCE, rtol=0)


if __name__ == "__main__":
    rows = [outcome(scene, skeleton) for scene, skeleton in samples()]
    PINS.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")
