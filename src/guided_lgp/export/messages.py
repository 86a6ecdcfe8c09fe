"""A motion as ``trajectory_msgs/JointTrajectory`` in JSON, and as a table."""

import csv
import json
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

from guided_lgp.documents import write_text
from guided_lgp.export.motion import Motion, Segment

_DECIMALS = 9


def trajectory_document(motion: Motion) -> dict[str, Any]:
    """The JSON document: where the robot starts, and one segment per action.

    A segment has a ``trajectory_msgs/JointTrajectory`` for each controller that comes to rest in
    it, and the commands to the grippers. A header's stamp is when a trajectory is sent, from the
    plan's start; the times of its points count from there, and those of a gripper's commands from
    the stamp of its fingers.
    """
    return {
        "robot": motion.robot.name,
        "start": dict(zip(motion.joint_names, _rounded(motion.positions[0]), strict=True)),
        "segments": [
            {
                "action": segment.action,
                "trajectories": {
                    group: _joint_trajectory(motion, segment, group)
                    for group in motion.groups()
                    if group in segment.parts
                },
                "gripper_commands": [
                    command
                    for gripper, (start, end) in segment.fingers().items()
                    for command in _commands(motion, gripper, start, end)
                ],
            }
            for segment in motion.segments
        ],
    }


def _commands(motion: Motion, gripper: str, start: int, end: int) -> list[dict[str, Any]]:
    clock = motion.nanoseconds
    return [
        {
            "gripper": gripper,
            "time_from_start": _duration(clock[command.row] - clock[start]),
            "position": round(command.opening, _DECIMALS),
        }
        for command in motion.commands
        if command.gripper == gripper and start <= command.row < end
    ]


def _joint_trajectory(motion: Motion, segment: Segment, group: str) -> dict[str, Any]:
    columns = motion.columns(motion.groups()[group])
    clock, (start, _) = motion.nanoseconds, segment.parts[group]
    return {
        "header": {"stamp": _duration(clock[start]), "frame_id": ""},
        "joint_names": [motion.joint_names[column] for column in columns],
        "points": [
            {
                "positions": _rounded(motion.positions[row, columns]),
                "velocities": _rounded(motion.velocities[row, columns]),
                "accelerations": _rounded(motion.accelerations[row, columns]),
                "effort": [],
                "time_from_start": _duration(clock[row] - clock[start]),
            }
            for row in segment.points(group)
        ],
    }


def _rounded(values: Any) -> list[float]:
    return [round(value, _DECIMALS) for value in values.tolist()]


def _duration(nanoseconds: int) -> dict[str, int]:
    seconds, rest = divmod(nanoseconds, 10**9)
    return {"sec": seconds, "nanosec": rest}


def write_json_trajectory(motion: Motion, path: Path) -> None:
    """Write :func:`trajectory_document`.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, json.dumps(trajectory_document(motion), indent=1, allow_nan=False) + "\n")


def write_csv_trajectory(motion: Motion, path: Path) -> None:
    """Write a row per point: time (ns), action, then position, velocity, acceleration per joint.

    Raises:
        InputError: the file cannot be written.
    """
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    kinds = ("position", "velocity", "acceleration")
    writer.writerow(
        ["time_ns", "action", *(f"{kind}:{name}" for kind in kinds for name in motion.joint_names)]
    )
    writer.writerows(_csv_rows(motion))
    write_text(path, stream.getvalue())


def _csv_rows(motion: Motion) -> Iterator[list[object]]:
    clock = motion.nanoseconds
    for segment in motion.segments:
        for row in segment.rows:
            figures = (motion.positions[row], motion.velocities[row], motion.accelerations[row])
            yield [clock[row], segment.action, *(v for part in figures for v in _rounded(part))]
