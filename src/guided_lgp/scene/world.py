"""The scene in PyBullet: the judge of collisions, and the camera."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from types import TracebackType
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from guided_lgp.poses import Array, compose
from guided_lgp.scene.bodies import TABLE_THICKNESS, Body, Box, colour_of
from guided_lgp.scene.bullet import pybullet
from guided_lgp.scene.model import Column, Scene
from guided_lgp.scene.shapes import Convex, Vector
from guided_lgp.scene.tolerances import MARGIN

_OTHER_BOX, _OTHER_TABLE = (0.25, 0.65, 0.68), (0.78, 0.66, 0.50)
_LEGS, _FLOOR = (0.45, 0.42, 0.40), (0.93, 0.94, 0.95)
Placement = Array | Sequence[float]
"""A pose (7,); lists are passed to PyBullet several times faster than arrays."""
BOX_DENSITY = 400.0
"""kg/m³ of every box."""
_FRICTION = 0.8
_SPINNING_FRICTION = 0.01  # m: faces that touch resist turning, their contact points alone do not


@dataclass(frozen=True, order=True)
class Penetration:
    """Two bodies (links, boxes or tables, by name) that overlap by ``depth`` (m)."""

    first: str
    second: str
    depth: float

    @property
    def bodies(self) -> frozenset[str]:
        """The two names."""
        return frozenset((self.first, self.second))


@dataclass(frozen=True)
class Camera:
    """A camera that looks from ``eye`` to ``target`` (m, world); angle of view in degrees."""

    eye: tuple[float, float, float] = (2.75, 1.25, 1.85)
    target: tuple[float, float, float] = (0.22, 0.0, 0.76)
    view: float = 38.0
    width: int = 960
    height: int = 720


class World:
    """A scene loaded into a PyBullet client of its own (no window).

    Robot links are the convex hulls of the meshes, as PyBullet loads them. Self-collision pairs
    that the SRDF disables and pairs of bodies that never move are not looked at. The client is
    freed at the end of a ``with`` block, by :meth:`close`, or with the object; it takes 36 MB.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.client: int = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("PyBullet has no client left: close worlds that are not needed")
        self._free = finalize(self, pybullet.disconnect, physicsClientId=self.client)
        self._description = scene.robot.description
        base = scene.robot.base_pose
        self.robot: int = pybullet.loadURDF(
            str(self._description.urdf),
            basePosition=base[:3],
            baseOrientation=base[3:],
            useFixedBase=True,
            flags=pybullet.URDF_USE_SELF_COLLISION,
            physicsClientId=self.client,
        )
        self.joints: dict[str, int] = {}
        self.links: dict[str, int] = {self._description.base_link: -1}
        for index in range(pybullet.getNumJoints(self.robot, physicsClientId=self.client)):
            info = pybullet.getJointInfo(self.robot, index, physicsClientId=self.client)
            self.joints[info[1].decode()] = index
            self.links[info[12].decode()] = index
        self._moved = [self.joints[joint] for joint in self._description.moving_joints]
        self._hands = [
            (gripper, arm.fingers.opened, arm.fingers.ratios.tolist())
            for gripper, arm in self._description.arms.items()
        ]
        for joint, value in scene.robot.fixed_values.items():
            pybullet.resetJointState(
                self.robot, self.joints[joint], value, physicsClientId=self.client
            )
        self.supports = {body.name: self._add(body) for body in scene.supports}
        self.boxes = {
            box.name: self._add(box, BOX_DENSITY * box.convex.volume) for box in scene.movable
        }
        self._obstacles = {body.name: self._add(body) for body in scene.in_the_way}
        self._names: dict[tuple[int, int], str] = {
            (self.robot, index): link for link, index in self.links.items()
        }
        self._names |= {
            (body, -1): n for n, body in (self.supports | self.boxes | self._obstacles).items()
        }
        self._parts = {name: part for part, name in self._names.items()}
        self._filter_pairs()
        self._dressed = False
        self.set(scene.robot.start, initial_poses(scene))

    def __enter__(self) -> "World":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the client; the world cannot be used afterwards."""
        self._free()

    def set(
        self,
        q: Array,
        boxes: Mapping[str, Placement],
        fingers: Mapping[str, float] | None = None,
    ) -> None:
        """Put the robot and the boxes somewhere, without simulation.

        Args:
            q: configuration (n,) in rad.
            boxes: pose (7,) of each box that is to be moved.
            fingers: value (rad or m) of the fingers by gripper; open where not given.
        """
        fingers = fingers or {}
        values = [[value] for value in np.asarray(q, float).tolist()]
        for gripper, opened, ratios in self._hands:
            value = fingers.get(gripper, opened)
            values += [[ratio * value] for ratio in ratios]
        pybullet.resetJointStatesMultiDof(
            self.robot, self._moved, values, physicsClientId=self.client
        )
        for name, placement in boxes.items():
            pybullet.resetBasePositionAndOrientation(
                self.boxes[name], placement[:3], placement[3:], physicsClientId=self.client
            )

    def penetrations(
        self, margin: float = MARGIN, touching: Iterable[tuple[str, str]] = ()
    ) -> list[Penetration]:
        """Pairs of bodies that overlap by more than ``margin`` (m), deepest first.

        Every contact the collision detection reports is measured again from scratch, as its
        cached contact points depend on what was asked before. Pairs that are said to be
        ``touching`` are left out.
        """
        pybullet.performCollisionDetection(physicsClientId=self.client)
        suspects = {
            ((contact[1], contact[3]), (contact[2], contact[4]))
            for contact in pybullet.getContactPoints(physicsClientId=self.client)
            if contact[8] < 0
        }
        pairs = [(self._parts[one], self._parts[other]) for one, other in touching]
        suspects.difference_update(pairs, [pair[::-1] for pair in pairs])
        found = []
        for first, second in suspects:
            depth = -self._distance(first, second)
            if depth > margin:
                names = sorted((self._names[first], self._names[second]))
                found.append(Penetration(names[0], names[1], depth))
        return sorted(set(found), key=lambda overlap: (-overlap.depth, overlap.first))

    def distance(self, first: str, second: str, limit: float = 1.0) -> float:
        """Distance (m) of two bodies by name, negative if they overlap; ``limit`` if farther."""
        return self._distance(self._parts[first], self._parts[second], limit)

    def link_poses(self, links: Iterable[str]) -> Array:
        """Poses (n, 7) of link frames in the world."""
        indices = [self.links[link] for link in links]
        states = pybullet.getLinkStates(
            self.robot, indices, computeForwardKinematics=True, physicsClientId=self.client
        )
        return np.array([[*state[4], *state[5]] for state in states])

    def tool_poses(self, grippers: Iterable[str]) -> Array:
        """Poses (n, 7) of the grippers' tool frames in the world."""
        arms = [self._description.arms[gripper] for gripper in grippers]
        links = self.link_poses(arm.tool_link for arm in arms)
        if all(arm.tool_is_link for arm in arms):
            return links  # a third of a keyframe's check would go into the composition
        return compose(links, np.array([arm.tool_in_link for arm in arms]))

    def render(self, camera: Camera | None = None) -> NDArray[np.uint8]:
        """A picture (height, width, 3) of the world as it is, drawn without a graphics card."""
        camera = camera or Camera()
        if not self._dressed:
            self._dress()
        view = pybullet.computeViewMatrix(camera.eye, camera.target, (0, 0, 1))
        projection = pybullet.computeProjectionMatrixFOV(
            camera.view, camera.width / camera.height, 0.1, 20.0
        )
        image = pybullet.getCameraImage(
            2 * camera.width,
            2 * camera.height,
            view,
            projection,
            lightDirection=(1.6, 0.9, 3.0),
            lightColor=(1, 1, 1),
            lightAmbientCoeff=0.55,
            lightDiffuseCoeff=0.5,
            lightSpecularCoeff=0.05,
            shadow=False,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        # Twice as fine and averaged: smooth edges.
        pixels = np.reshape(image[2], (camera.height, 2, camera.width, 2, 4))
        return np.asarray(pixels[..., :3].mean(axis=(1, 3)).round().astype(np.uint8))

    def _distance(
        self, first: tuple[int, int], second: tuple[int, int], limit: float = 0.0
    ) -> float:
        points = pybullet.getClosestPoints(
            first[0],
            second[0],
            limit,
            first[1],
            second[1],
            physicsClientId=self.client,
        )
        return min((float(point[8]) for point in points), default=limit)

    def _add(self, body: Body | Column, mass: float = 0.0) -> int:
        """Load a body where the scene has it; without a mass (kg), it never moves."""
        looks = pybullet.createVisualShape(
            **_geometry(body.convex),
            rgbaColor=(*_colour(body), 1.0),
            specularColor=(0.1, 0.1, 0.1),
            physicsClientId=self.client,
        )
        shape = pybullet.createCollisionShape(
            **_geometry(body.convex, collision=True), physicsClientId=self.client
        )
        placement = body.placement
        number: int = pybullet.createMultiBody(
            mass,
            shape,
            looks,
            placement[:3],
            placement[3:],
            physicsClientId=self.client,
        )
        pybullet.changeDynamics(
            number,
            -1,
            lateralFriction=_FRICTION,
            spinningFriction=_SPINNING_FRICTION,
            physicsClientId=self.client,
        )
        return number

    def _dress(self) -> None:
        """Colour the robot, put legs under the tables and a floor under it all: looks only."""
        for link, index in self.links.items():
            dark = any(part in link for part in ("finger", "wrist", "elbow", "head", "laser"))
            colour = (0.32, 0.33, 0.36, 1.0) if dark else (0.84, 0.84, 0.82, 1.0)
            pybullet.changeVisualShape(
                self.robot, index, rgbaColor=colour, physicsClientId=self.client
            )
        self._add_decoration((9.0, 9.0, 0.005), (0.0, 0.0, -0.005), _FLOOR)
        for table in self.scene.tables:
            x, y, z = table.position
            height = (z - TABLE_THICKNESS) / 2
            self._add_decoration((0.03, 0.03, height), (x, y, height), _LEGS)
            self._add_decoration((0.14, 0.10, 0.01), (x, y, 0.01), _LEGS)
        self._dressed = True

    def _add_decoration(
        self,
        half: tuple[float, float, float],
        position: tuple[float, float, float],
        colour: tuple[float, float, float],
    ) -> None:
        looks = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=half,
            rgbaColor=(*colour, 1.0),
            specularColor=(0, 0, 0),
            physicsClientId=self.client,
        )
        pybullet.createMultiBody(0.0, -1, looks, position, physicsClientId=self.client)

    def _filter_pairs(self) -> None:
        """Switch off the pairs that the SRDF disables and those of bodies that never move."""
        solid = [
            link
            for link, index in self.links.items()
            if pybullet.getCollisionShapeData(self.robot, index, physicsClientId=self.client)
        ]
        moving = self._description.moving_links
        self.fixed_links = tuple(link for link in solid if link not in moving)
        disabled = self._description.disabled_pairs
        for one, other in combinations(solid, 2):
            if not {one, other} & moving or frozenset((one, other)) in disabled:
                self._ignore(self._parts[one], self._parts[other])
        for body in (*self.supports.values(), *self._obstacles.values()):
            for link in self.fixed_links:
                self._ignore(self._parts[link], (body, -1))

    def _ignore(self, first: tuple[int, int], second: tuple[int, int]) -> None:
        pybullet.setCollisionFilterPair(
            first[0], second[0], first[1], second[1], 0, physicsClientId=self.client
        )


@lru_cache(maxsize=1)
def world_of(scene: Scene) -> World:
    """The world in which a scene's validation and both bounds judge; kept for the last scene.

    It takes a third of a second to load. Whoever asks first puts the robot and all boxes somewhere,
    so that no verdict depends on what was asked before.
    """
    return World(scene)


def initial_poses(scene: Scene) -> dict[str, Array]:
    """Pose (7,) of every box at the start."""
    return _poses(scene, scene.robot.start)


def poses_at_side(scene: Scene) -> dict[str, Array]:
    """Pose (7,) of every box when the arms have gone to their side, before the first action."""
    return _poses(scene, at_side(scene))


def at_side(scene: Scene) -> Array:
    """Configuration (n,) of arms at their side; one stays whose box carries others at the start."""
    robot = scene.robot.description
    q = robot.home.copy()
    for gripper in scene.loaded.values():
        arm = robot.arms[gripper].slice
        q[arm] = scene.robot.start[arm]
    return q


def _poses(scene: Scene, q: Array) -> dict[str, Array]:
    poses = {box.name: box.placement for box in scene.movable}
    for box in scene.movable:
        if box.grasp is not None:
            tool = scene.robot.tool_pose(q, scene.held[box.name])
            poses[box.name] = compose(tool, np.array(box.grasp))
    return poses


def _colour(body: Body | Column) -> Vector:
    if isinstance(body, Column):
        return _LEGS
    other = _OTHER_BOX if isinstance(body, Box) and not body.fixed else _OTHER_TABLE
    return colour_of(body) or other


def _geometry(convex: Convex, collision: bool = False) -> dict[str, Any]:
    """The arguments by which PyBullet takes a shape."""
    if convex.shape == "mesh":
        vertices = {"vertices": [list(vertex) for vertex in convex.vertices]}
        faces = {} if collision else {"indices": convex.faces().ravel().tolist()}
        return {"shapeType": pybullet.GEOM_MESH, **vertices, **faces}
    if convex.shape == "cylinder":
        radius, _, half = convex.half
        height = {"height" if collision else "length": 2 * half}
        return {"shapeType": pybullet.GEOM_CYLINDER, "radius": radius, **height}
    return {"shapeType": pybullet.GEOM_BOX, "halfExtents": convex.half}
