"""A film of a motion: pictures that change, as fast as they should, and the same bytes again."""

from pathlib import Path

import numpy as np
from PIL import Image

from guided_lgp.bounds.results import Trajectory
from guided_lgp.scene import load_scene
from guided_lgp.view.film import write_film

SCENE = load_scene(Path(__file__).parents[2] / "examples" / "three_boxes.json")


def test_a_film_shows_the_motion(tmp_path: Path) -> None:
    robot = SCENE.robot.description
    rows = np.zeros((9, len(robot.moving_joints)))
    rows[:, : len(robot.home)] = robot.home
    rows[:, 0] += np.linspace(0.0, 0.6, 9)
    motion = Trajectory(robot.moving_joints, np.linspace(0.0, 1.6, 9), rows, ())
    for name in ("first", "second"):
        write_film(motion, SCENE, tmp_path / f"{name}.gif", speed=4.0, width=160)
    with Image.open(tmp_path / "first.gif") as film:
        assert film.size == (160, 100)
        assert getattr(film, "n_frames", 1) == 7  # 0.4 s at 12.5 per s, the first and the last
        pictures = []
        for frame in (0, 6):
            film.seek(frame)
            pictures.append(np.asarray(film.convert("RGB"), float))
    assert np.abs(pictures[0] - pictures[1]).max() > 50
    assert (tmp_path / "first.gif").read_bytes() == (tmp_path / "second.gif").read_bytes()
