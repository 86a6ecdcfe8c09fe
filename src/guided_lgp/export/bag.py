"""A motion as a ROS 2 bag in MCAP."""

from pathlib import Path
from typing import Any

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from guided_lgp.documents import made_whole
from guided_lgp.errors import InputError
from guided_lgp.export.motion import Motion, Segment

_STORE = get_typestore(Stores.ROS2_JAZZY)


def write_bag(motion: Motion, folder: Path) -> None:
    """Write the trajectories of every controller, and the joint states.

    Topics are ``/GRIPPER/arm/joint_trajectory`` and ``/GRIPPER/fingers/joint_trajectory`` with one
    message per action, and ``/joint_states`` with one per point. A message is written at the time
    of its header's stamp, which counts from the plan's start.

    Args:
        motion: what to write.
        folder: made; a bag is a folder.

    Raises:
        InputError: the folder exists, or cannot be made.
    """
    if folder.exists():
        raise InputError(str(folder), "exists", "a new folder")
    clock = motion.nanoseconds
    with (
        made_whole(folder) as own,
        Writer(own, version=9, storage_plugin=StoragePlugin.MCAP) as bag,
    ):
        for group, joints in motion.groups().items():
            trajectories = [
                (clock[segment.parts[group][0]], _trajectory(motion, segment, group, joints))
                for segment in motion.segments
                if group in segment.parts
            ]
            _write(bag, f"/{group}/joint_trajectory", trajectories)
        _write(bag, "/joint_states", [(t, _state(motion, row)) for row, t in enumerate(clock)])


def _write(bag: Writer, topic: str, messages: list[tuple[int, Any]]) -> None:
    kind = messages[0][1].__msgtype__
    connection = bag.add_connection(topic, kind, typestore=_STORE)
    for nanoseconds, message in messages:
        bag.write(connection, nanoseconds, _STORE.serialize_cdr(message, kind))


def _trajectory(motion: Motion, segment: Segment, group: str, joints: tuple[str, ...]) -> Any:
    columns, clock, (start, _) = motion.columns(joints), motion.nanoseconds, segment.parts[group]
    points = [
        _message(
            "trajectory_msgs/msg/JointTrajectoryPoint",
            positions=motion.positions[row, columns],
            velocities=motion.velocities[row, columns],
            accelerations=motion.accelerations[row, columns],
            effort=motion.positions[row, :0],
            time_from_start=_time("Duration", clock[row] - clock[start]),
        )
        for row in segment.points(group)
    ]
    return _message(
        "trajectory_msgs/msg/JointTrajectory",
        header=_header(clock[start]),
        joint_names=list(joints),
        points=points,
    )


def _state(motion: Motion, row: int) -> Any:
    return _message(
        "sensor_msgs/msg/JointState",
        header=_header(motion.nanoseconds[row]),
        name=list(motion.joint_names),
        position=motion.positions[row],
        velocity=motion.velocities[row],
        effort=motion.positions[row, :0],
    )


def _header(nanoseconds: int) -> Any:
    return _message("std_msgs/msg/Header", stamp=_time("Time", nanoseconds), frame_id="")


def _time(kind: str, nanoseconds: int) -> Any:
    seconds, rest = divmod(nanoseconds, 10**9)
    return _message(f"builtin_interfaces/msg/{kind}", sec=seconds, nanosec=rest)


def _message(kind: str, **fields: Any) -> Any:
    return _STORE.types[kind](**fields)
