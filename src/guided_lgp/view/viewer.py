"""A scene in viser: the robot from its meshes, tables and boxes, each movable by name."""

import io
from collections.abc import Mapping
from colorsys import hsv_to_rgb
from contextlib import redirect_stdout
from itertools import count
from typing import Any, Self

import numpy as np
import pinocchio
import viser

from guided_lgp.poses import Array, pose
from guided_lgp.scene.model import Scene
from guided_lgp.scene.world import COLOURS, TABLE_THICKNESS

Colour = tuple[float, float, float]

_SHELL, _HAND = (0.89, 0.89, 0.88), (0.47, 0.48, 0.51)
_OTHER_TABLE = (0.81, 0.75, 0.66)
_FIRST_HUE, _HUE_STEP = 0.51, (5**0.5 - 1) / 2
"""Hues of the boxes that no colour is named after, in turns from red: teal, then golden sections
of the circle, which keep any number of hues apart."""

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
        self._robot = scene.robot.description
        self._model = pinocchio.buildModelFromUrdf(str(self._robot.urdf))
        self._data = self._model.createData()
        self._q = pinocchio.neutral(self._model)
        self._joints: dict[str, Any] = {}
        self._boxes: dict[str, Any] = {}
        self._add_surroundings()
        self._add_robot()
        self._add_tables_and_boxes()
        self.configure(dict(zip(self._robot.joint_names, self._robot.home.tolist(), strict=True)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    def configure(self, joints: Mapping[str, float]) -> None:
        """Move joints by name (rad, m where prismatic); the others stay."""
        for name, value in joints.items():
            joint = self._model.joints[self._model.getJointId(name)]
            # pinocchio stores a continuous joint as the cosine and sine of its angle.
            coordinates = value if joint.nq == 1 else (np.cos(value), np.sin(value))
            self._q[joint.idx_q : joint.idx_q + joint.nq] = coordinates
        pinocchio.forwardKinematics(self._model, self._data, self._q)
        for name in joints:
            local = self._data.liMi[self._model.getJointId(name)]
            _move(self._joints[name], np.array(pinocchio.SE3ToXYZQUAT(local)))

    def move_box(self, name: str, box_pose: Array) -> None:
        """Put a box at a pose (7,) in the world."""
        _move(self._boxes[name], box_pose)

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
        root = f"/{self._robot.name}"
        scene.add_frame(root, show_axes=False, **_pose(self.scene.robot.base_pose))
        for joint, value in self.scene.robot.fixed_values.items():
            self._q[self._model.joints[self._model.getJointId(joint)].idx_q] = value
        pinocchio.forwardKinematics(self._model, self._data, self._q)
        paths = [root]
        for index in range(1, self._model.njoints):
            name = self._model.names[index]
            paths.append(f"{paths[self._model.parents[index]]}/{name}")
            local = np.array(pinocchio.SE3ToXYZQUAT(self._data.liMi[index]))
            self._joints[name] = scene.add_frame(paths[index], show_axes=False, **_pose(local))
        visuals = pinocchio.buildGeomFromUrdf(
            self._model, str(self._robot.urdf), pinocchio.GeometryType.VISUAL
        )
        hands = {link for arm in self._robot.arms.values() for link in arm.hand_links}
        for visual in visuals.geometryObjects:
            mesh = visual.geometry
            # The primitive shapes of the description mark sensor frames, a few mm wide.
            if not hasattr(mesh, "num_tris"):
                continue
            link, _, _ = visual.name.rpartition("_")
            scene.add_mesh_simple(
                f"{paths[visual.parentJoint]}/{visual.name}",
                np.asarray(mesh.vertices()),
                np.array(
                    [[mesh.tri_indices(i)[k] for k in range(3)] for i in range(mesh.num_tris)]
                ),
                color=_HAND if link in hands else _SHELL,
                flat_shading=True,
                **_pose(np.array(pinocchio.SE3ToXYZQUAT(visual.placement))),
            )

    def _add_tables_and_boxes(self) -> None:
        scene = self.server.scene
        for column in self.scene.robot.columns:
            length, width, height = (2 * half for half in column.half)
            dimensions = (length, width, height)
            scene.add_box("/column", _OTHER_TABLE, dimensions, **_pose(column.placement))
        for table in self.scene.tables:
            x, y, top = table.position
            scene.add_box(
                f"/tables/{table.name}",
                COLOURS.get(table.name, _OTHER_TABLE),
                (2 * table.half_extents[0], 2 * table.half_extents[1], TABLE_THICKNESS),
                cast_shadow=False,
                **_pose(pose((x, y, top - TABLE_THICKNESS / 2), table.yaw)),
            )
            self._label(f"/tables/{table.name}", (table.half_extents[0], 0.0, -0.05))
        for box, colour in zip(self.scene.boxes, box_colours(self.scene), strict=True):
            self._boxes[box.name] = scene.add_box(
                f"/boxes/{box.name}",
                colour,
                box.size,
                **_pose(pose(box.position, box.yaw)),
            )
            self._label(f"/boxes/{box.name}", (0.0, 0.0, box.size[2] / 2 + 0.01))

    def _label(self, body: str, position: tuple[float, float, float]) -> None:
        """Write a body's name beside it, where it goes with it."""
        name = body.rpartition("/")[-1]
        self.server.scene.add_label(
            f"{body}/name", name, position=position, font_screen_scale=0.8, anchor="bottom-center"
        )


def box_colours(scene: Scene) -> list[Colour]:
    """The colour (RGB in 0..1) of each box: what its name says, else one of its own."""
    hues = (_FIRST_HUE + number * _HUE_STEP for number in count())
    return [
        COLOURS[box.name] if box.name in COLOURS else hsv_to_rgb(next(hues) % 1, 0.63, 0.68)
        for box in scene.boxes
    ]


def _pose(transform: Array) -> dict[str, Any]:
    """The arguments by which viser takes a pose (7,)."""
    return {"position": transform[:3], "wxyz": transform[[6, 3, 4, 5]]}


def _move(node: Any, transform: Array) -> None:
    """Set a node's pose, sending only what changed."""
    for attribute, value in _pose(transform).items():
        if not np.allclose(getattr(node, attribute), value, rtol=0.0, atol=1e-5):
            setattr(node, attribute, value)
