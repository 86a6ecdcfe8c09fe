"""A scene in viser: the robot from its meshes, tables and boxes, each movable by name."""

import io
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import Any

import numpy as np
import viser

from guided_lgp.poses import Array
from guided_lgp.scene.model import Scene
from guided_lgp.view.bodies import Body, box_path, fixed_bodies, movable_bodies
from guided_lgp.view.motion import DIGITS
from guided_lgp.view.robot_shapes import RobotShapes

FIELD_OF_VIEW = 0.75
"""Of the camera, from bottom to top (rad): the whole robot."""


class Viewer:
    """A viser server on the loopback interface that shows one scene.

    The robot is a tree of frames, one per moving joint, so that a motion only sends the pose of
    the joints that turn. Use it as a context manager: leaving it stops the server.
    """

    def __init__(self, scene: Scene, port: int = 8080) -> None:
        """Start the server and draw the scene with all arms at their side.

        Args:
            scene: the scene to draw.
            port: TCP port on 127.0.0.1; the next free one is taken if it is in use.
        """
        self.scene = scene
        # viser announces itself on standard output, which belongs to our own results.
        with redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer("127.0.0.1", port, scene.name, verbose=False)
        self._robot = RobotShapes(scene)
        self._joints: dict[str, Any] = {}
        self._boxes: dict[str, Any] = {}
        self._add_surroundings()
        self._add_robot()
        self._add_tables_and_boxes()

    def __enter__(self) -> "Viewer":
        return self

    def __exit__(self, *_: object) -> None:
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    def configure(self, joints: Mapping[str, float]) -> None:
        """Move joints by name (rad, m where prismatic); the others stay."""
        for path, local in self._robot.configure(joints).items():
            _move(self._joints[path], local)

    def move_box(self, name: str, box_pose: Array) -> None:
        """Put a box at a pose (7,) in the world."""
        _move(self._boxes[box_path(name)], box_pose)

    def _add_surroundings(self) -> None:
        scene = self.server.scene
        scene.set_up_direction("+z")
        scene.add_grid("/floor", 4.0, 4.0, cell_size=0.5, section_size=1.0)
        camera = self.server.initial_camera
        camera.position = (2.6, -0.7, 1.8)
        camera.look_at = (0.2, 0.0, 0.72)
        camera.fov = FIELD_OF_VIEW

    def _add_robot(self) -> None:
        scene = self.server.scene
        root = self._robot.root
        scene.add_frame(root, show_axes=False, **_pose(self.scene.robot.base_pose))
        for path, local in self._robot.all_frames().items():
            self._joints[path] = scene.add_frame(path, show_axes=False, **_pose(local))
        for mesh in self._robot.meshes():
            scene.add_mesh_simple(
                mesh.path,
                mesh.vertices,
                mesh.triangles,
                color=mesh.colour,
                flat_shading=True,
                **_pose(mesh.placement),
            )

    def _add_tables_and_boxes(self) -> None:
        for body in fixed_bodies(self.scene):
            self._add_body(body, cast_shadow=False)
        for body in movable_bodies(self.scene):
            self._boxes[body.path] = self._add_body(body)

    def _add_body(self, body: Body, **options: Any) -> Any:
        """Draw a body, and beside it its name, which goes with it."""
        scene, convex = self.server.scene, body.convex
        options |= _pose(body.placement)
        node: Any
        if convex.shape == "box":
            node = scene.add_box(body.path, body.colour, convex.size, **options)
        else:
            vertices, faces = convex.points(), convex.faces()
            node = scene.add_mesh_simple(
                body.path, vertices, faces, color=body.colour, flat_shading=True, **options
            )
        if body.name:
            scene.add_label(
                f"{body.path}/name",
                body.name,
                position=body.label,
                font_screen_scale=0.8,
                anchor="bottom-center",
            )
        return node


def _pose(transform: Array) -> dict[str, Any]:
    """The arguments by which viser takes a pose (7,)."""
    rounded = np.round(transform, DIGITS) + 0.0  # not -0.0
    return {"position": rounded[:3], "wxyz": rounded[[6, 3, 4, 5]]}


def _move(node: Any, transform: Array) -> None:
    """Set a node's pose, sending only what changed."""
    for attribute, value in _pose(transform).items():
        if not np.allclose(getattr(node, attribute), value, rtol=0.0, atol=1e-5):
            setattr(node, attribute, value)
