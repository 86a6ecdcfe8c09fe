"""The Gymnasium environment: it passes the library's own check; the bounds give the verdicts."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from guided_lgp.errors import InputError
from guided_lgp.export.gym import TaskEnv
from guided_lgp.scene import load_scene

SCENE = load_scene(Path(__file__).parents[1] / "examples" / "three_boxes.json")


def number(env: TaskEnv, text: str) -> int:
    return [str(action) for action in env.actions].index(text)


def test_the_library_finds_no_fault() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(
            TaskEnv(SCENE, ["(on red green)"], render_mode="rgb_array"), skip_render_check=True
        )


def test_an_episode_ends_with_a_verified_motion() -> None:
    env = TaskEnv(SCENE, ["(on red green)"])
    start, info = env.reset(seed=1)
    assert not start["goals"].any()
    assert info["action_mask"][number(env, "(place pr2L red green)")] == 0
    refused = env.step(number(env, "(place pr2L red green)"))
    assert (refused[1], refused[4]["verdict"]) == (-0.1, "not applicable")
    assert all(np.array_equal(refused[0][key], start[key]) for key in start)
    _, reward, done, _, info = env.step(number(env, "(grasp pr2L red)"))
    assert (reward, done, info["verdict"]) == (0.0, False, "feasible")
    end, reward, done, truncated, _ = env.step(number(env, "(place pr2L red green)"))
    assert (reward, done, truncated) == (1.0, True, False)
    assert end["goals"].all()
    again, _ = env.reset()
    assert all(np.array_equal(again[key], start[key]) for key in start)


def test_geometry_refuses_with_its_reason_and_episodes_are_cut() -> None:
    scene = load_scene(Path(__file__).parents[1] / "examples" / "impossible_reach.json")
    env = TaskEnv(scene, ["(on red shelf)"], max_steps=2)
    env.reset(seed=1)
    for action in ("(grasp pr2L red)", "(place pr2L red shelf)"):
        _, reward, done, truncated, info = env.step(number(env, action))
    assert (reward, done, truncated, info["verdict"]) == (-0.1, False, True, "infeasible")
    assert info["reason"]


def test_a_faulty_task_is_refused() -> None:
    with pytest.raises(InputError, match="unknown table"):
        TaskEnv(SCENE, ["(on red shelf)"])
