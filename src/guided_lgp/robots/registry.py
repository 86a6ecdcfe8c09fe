"""The robots that are known by name: the files beside this one."""

from dataclasses import replace
from functools import cache
from pathlib import Path

from guided_lgp.errors import InputError
from guided_lgp.robots.build import read_robot
from guided_lgp.robots.robot import Robot

_FOLDER = Path(__file__).parent


def robot_names() -> tuple[str, ...]:
    """The robots that ship with the package."""
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.yaml")))


@cache
def load_robot(name: str) -> Robot:
    """A robot by its name, or from a file.

    Args:
        name: one of :func:`robot_names`, or the path of a robot file (``.yaml``).

    Raises:
        InputError: there is no such robot, or its file has a fault.
    """
    if name in robot_names():
        return read_robot(_FOLDER / f"{name}.yaml")
    if not name.endswith(".yaml"):
        accepted = f"{', '.join(robot_names())}, or the path of a robot file (.yaml)"
        raise InputError("model", f"unknown robot {name!r}", accepted)
    return read_robot(Path(name).resolve())


@cache
def tilted_robot(name: str, roll: float, pitch: float) -> Robot:
    """A robot whose base link is not level, see :func:`load_robot`; angles in rad."""
    return replace(load_robot(name), tilt=(roll, pitch))
