"""A plan as a Rerun recording: a file for the Rerun viewer, with its own time line."""

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from guided_lgp.bounds.results import Trajectory
from guided_lgp.documents import written_whole
from guided_lgp.errors import InputError
from guided_lgp.logic import Objective, Skeleton, format_objective
from guided_lgp.poses import Array
from guided_lgp.scene.model import Scene
from guided_lgp.view.bodies import Body, box_path, fixed_bodies, movable_bodies
from guided_lgp.view.motion import frames, show, steps
from guided_lgp.view.robot_shapes import Colour, RobotShapes

TIMELINE = "plan"
"""The recording's time: s from the start of the motion."""
PLAN = "/plan"
"""Where the goals are, and below it the actions of each hand."""


def write_recording(
    trajectory: Trajectory,
    scene: Scene,
    path: Path,
    skeleton: Skeleton = (),
    objective: Objective = (),
) -> None:
    """Write a ``.rrd`` file that ``rerun FILE`` plays.

    Args:
        trajectory: the motion of a plan.
        scene: the scene it starts in.
        path: the file to write; its folder is made.
        skeleton: the plan's actions, logged where they begin.
        objective: the goals.

    Raises:
        InputError: Rerun is not installed, or the file cannot be written.
    """
    rerun = _rerun()
    with written_whole(path) as file:
        stream = rerun.RecordingStream("guided-lgp")
        stream.save(file)
        stage = _Stage(scene, rerun, stream)
        stream.log(PLAN, rerun.TextLog(format_objective(objective)), static=True)
        for frame in frames(scene, trajectory):
            stream.set_time(TIMELINE, duration=frame.time)
            show(stage, frame)
        for step in steps(scene, skeleton, trajectory) if skeleton else ():
            stream.set_time(TIMELINE, duration=step.time)
            stream.log(f"{PLAN}/{step.action.symbols[0]}", rerun.TextLog(str(step.action)))
        stream.disconnect()


def _rerun() -> ModuleType:
    try:
        import rerun
    except ImportError:
        remedy = "pip install 'guided-lgp[rerun]'"
        raise InputError("a Rerun recording", "needs the package rerun-sdk", remedy) from None
    return rerun


class _Stage:
    """A recording in the place of the 3D viewer; see :class:`guided_lgp.view.motion.Stage`."""

    def __init__(self, scene: Scene, rerun: Any, stream: Any) -> None:
        self._rerun = rerun
        self._stream = stream
        self._robot = RobotShapes(scene)
        stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._place(self._robot.root, scene.robot.base_pose, static=True)
        stream.set_time(TIMELINE, duration=0.0)  # what is static in Rerun never moves
        for path, local in self._robot.all_frames().items():
            self._place(path, local)
        for mesh in self._robot.meshes():
            self._place(mesh.path, mesh.placement, static=True)
            shape = rerun.Mesh3D(
                vertex_positions=mesh.vertices,
                triangle_indices=mesh.triangles,
                albedo_factor=_rgb(mesh.colour),
            )
            stream.log(mesh.path, shape, static=True)
        for body in fixed_bodies(scene):
            self._place(body.path, body.placement, static=True)
            self._draw(body)
        for body in movable_bodies(scene):
            self._draw(body)

    def configure(self, joints: Mapping[str, float]) -> None:
        for path, local in self._robot.configure(joints).items():
            self._place(path, local)

    def move_box(self, name: str, box_pose: Array) -> None:
        self._place(box_path(name), box_pose)

    def _draw(self, body: Body) -> None:
        if body.convex.shape == "box":
            shape = self._rerun.Boxes3D(
                sizes=[body.convex.size],
                colors=[_rgb(body.colour)],
                labels=[body.name] if body.name else None,
                fill_mode="solid",
            )
        else:
            shape = self._rerun.Mesh3D(
                vertex_positions=body.convex.points(),
                triangle_indices=body.convex.faces(),
                albedo_factor=_rgb(body.colour),
            )
        self._stream.log(body.path, shape, static=True)

    def _place(self, path: str, transform: Array, static: bool = False) -> None:
        """Log a pose (7,) in the parent's frame."""
        where = self._rerun.Transform3D(
            translation=transform[:3], quaternion=self._rerun.Quaternion(xyzw=transform[3:])
        )
        self._stream.log(path, where, static=static)


def _rgb(colour: Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in colour)
    return red, green, blue
