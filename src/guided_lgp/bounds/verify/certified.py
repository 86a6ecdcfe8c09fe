"""Keyframes in which surely nothing is deeper in something else than it may.

What is not certified is for PyBullet to judge, so a verdict is the same with this and without.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Protocol

import numpy as np

from guided_lgp.bounds.collision.certificate import Certificate
from guided_lgp.bounds.collision.shapes import bodies_of
from guided_lgp.bounds.results import Keyframe
from guided_lgp.bounds.verify.geometry import HAND_DEPTH
from guided_lgp.robots import Robot
from guided_lgp.robots.hand_parts import parts_of
from guided_lgp.scene import Scene
from guided_lgp.scene.tolerances import MARGIN

_SLACK = 0.004
"""How much less deep (m) than they may be certified bodies are: PyBullet makes its hulls 1 mm wider
and measures depths too great, if anything; single precision is off by 10 um at most."""

_Pair = tuple[str, str]


class Moment(Protocol):
    """Where all is at once, and what may touch."""

    @property
    def keyframe(self) -> Keyframe:
        """Arms and boxes."""

    @property
    def fingers(self) -> Mapping[str, float]:
        """Values of the fingers by gripper; open where not given."""

    @property
    def held(self) -> Sequence[_Pair]:
        """Boxes and grippers whose hands may touch them."""

    @property
    def support(self) -> Mapping[str, str]:
        """What boxes stand on."""


class KeyframeCertificate:
    """Says of moments in one scene in which of them all is surely apart."""

    def __init__(self, scene: Scene) -> None:
        robot = scene.robot.description
        model, geometry = bodies_of(scene)
        names = [str(body.name) for body in geometry.geometryObjects]
        self._boxes = [box.name for box in scene.movable]
        loose = range(len(names) - len(self._boxes), len(names))
        (template,) = robot.kinematics.rows(robot.home[None], scene.robot.fixed_values)
        self._certificate = Certificate(
            robot.urdf, model, template, geometry, robot.moving_joints, loose
        )
        self._fingers = [
            (gripper, arm.fingers.opened, arm.fingers.ratios.tolist())
            for gripper, arm in robot.arms.items()
        ]
        hands = {gripper: _firm_parts(robot, gripper) for gripper in robot.grippers}
        pairs = list(_pairs(robot, names, self._boxes))
        between = defaultdict[_Pair, list[int]](list)
        for number, (one, other) in enumerate(pairs):
            between[names[one], names[other]].append(number)
            between[names[other], names[one]].append(number)
        bodies = {*names} - {*robot.description.links}
        self._resting = {(b, below): between[b, below] for b in self._boxes for below in bodies}
        self._held = {
            (box, gripper): [number for link in links for number in between[link, box]]
            for gripper, links in hands.items()
            for box in self._boxes
        }
        deep = [pairs[number] for those in self._held.values() for number in those]
        self._pairs = np.array(pairs + deep, dtype=np.intc)
        deepest = np.repeat([MARGIN, HAND_DEPTH], [len(pairs), len(deep)])
        self._padding = (_SLACK - deepest).astype(np.float32)

    def clear(self, moments: Sequence[Moment]) -> list[bool]:
        """In which moments nothing is deeper in something else than it may."""
        values = np.array([self._moving(moment) for moment in moments])
        places = [moment.keyframe.boxes[box] for moment in moments for box in self._boxes]
        skipped = np.zeros((len(moments), len(self._pairs)), dtype=np.bool_)
        for row, moment in zip(skipped, moments, strict=True):
            row[self._touching(moment)] = True
        clear: list[bool] = self._certificate.apart(
            values, self._pairs, self._padding, np.concatenate(places), skipped
        ).tolist()
        return clear

    def _moving(self, moment: Moment) -> list[float]:
        """Values (m,) of all moving joints."""
        values: list[float] = moment.keyframe.q.tolist()
        for gripper, opened, ratios in self._fingers:
            value = moment.fingers.get(gripper, opened)
            values += [ratio * value for ratio in ratios]
        return values

    def _touching(self, moment: Moment) -> list[int]:
        """Pairs that may be in each other; of hands, others say that they are not too deep."""
        touching = [n for pair in moment.support.items() for n in self._resting[pair]]
        touching += [n for pair in moment.held for n in self._held[pair]]
        return touching


def _firm_parts(robot: Robot, gripper: str) -> tuple[str, ...]:
    """The links of a hand that may be deeper in what it holds than its pads."""
    pads = parts_of(robot, gripper).pads
    return tuple(link for link in robot.arms[gripper].hand_links if link not in pads)


def _pairs(robot: Robot, names: Sequence[str], boxes: Sequence[str]) -> Iterator[tuple[int, int]]:
    """Numbers of the bodies that PyBullet looks at, as :class:`World` has it: links come first."""
    parents, disabled = robot.description.parents, robot.disabled_pairs
    moving = {*robot.moving_links, *boxes}
    for first, second in combinations(range(len(names)), 2):
        one, other = names[first], names[second]
        related = one == other or parents.get(one) == other or parents.get(other) == one
        if {one, other} & moving and not related and frozenset((one, other)) not in disabled:
            yield first, second
