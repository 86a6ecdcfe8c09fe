"""Plans in the formats of other programs."""

from importlib import import_module
from pathlib import Path

from guided_lgp.bounds.plan_file import Plan
from guided_lgp.errors import InputError

_WRITERS = {
    ".json": "messages:write_json_trajectory",
    ".csv": "messages:write_csv_trajectory",
    "": "bag:write_bag",
}
"""What writes a motion, by the file's suffix; a ROS 2 bag is a folder."""


def export_plan(plan: Plan, path: Path, speed: float = 1.0) -> None:
    """Write a plan's motion for a robot.

    Args:
        plan: as read by :func:`guided_lgp.bounds.plan_file.read_plan`.
        path: its suffix says in which format: ``.json``, ``.csv``, or none for a ROS 2 bag.
        speed: share of the robot's speed, in (0, 1].

    Raises:
        InputError: an unknown suffix, a speed out of range, a plan that does not fit its scene, or
            a file that cannot be written.
    """
    from guided_lgp.export.motion import motion_of

    if path.suffix not in _WRITERS:
        raise InputError(str(path), "has an unknown suffix", ".json, .csv, or none for a ROS 2 bag")
    module, _, function = _WRITERS[path.suffix].partition(":")
    write = getattr(import_module(f"{__name__}.{module}"), function)
    write(motion_of(plan, speed), path)
