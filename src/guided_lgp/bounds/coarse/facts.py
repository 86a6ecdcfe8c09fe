"""Facts: what single arms cannot do in a scene, whatever else happens; each is proved once.

A fact is about one arm and one box: the box where it stands at the start, or anywhere on a support
that has not moved. It says "impossible" only where that is so without all other bodies; then every
sequence with such an action is infeasible.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from guided_lgp.bounds.coarse.formulation import straight_lines
from guided_lgp.bounds.coarse.unreachable import Grasp, Limb
from guided_lgp.bounds.program.context import Line
from guided_lgp.bounds.program.geometry import GraspSide, SceneGeometry
from guided_lgp.bounds.program.grasp import INSET, PALM_GAP, grasp_sides
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Array
from guided_lgp.logic import Action, Skeleton, State, successor
from guided_lgp.logic.domain import GroundInstruction
from guided_lgp.scene.tolerances import GRASP_ANGLE, GRASP_OFFSET

_KEPT = 400
"""How many sequences are kept to go on from."""


@dataclass(frozen=True)
class Hold:
    """A gripper holds a standing box and can move along straight lines, alone or with the box."""

    gripper: str
    box: str
    support: str | None
    """Where the box is: anywhere on a support at its start, or (None) at its own start."""
    lines: tuple[Line, ...]
    loaded: bool = False
    """Whether the box may carry others: then their common centre is on the support, not its own."""

    def __str__(self) -> str:
        return f"hold {self.gripper} {self.box}"


class Facts:
    """The facts of one scene."""

    def __init__(self, geometry: SceneGeometry) -> None:
        robot = geometry.scene.robot
        self._geometry = geometry
        self._arms = kinematics_of(robot.description).arms
        self._limbs = {name: Limb.of(arm, robot.fixed_values) for name, arm in self._arms.items()}
        self._known: dict[Hold, bool] = {}
        self._walked = lru_cache(_KEPT)(self._walk)
        self._asked = lru_cache(_KEPT)(self._held)

    def impossible(self, skeleton: Skeleton) -> Hold | None:
        """What makes the last action of a skeleton impossible, as far as facts go."""
        return next(filter(self.out_of_reach, self._holds(skeleton)), None)

    def known(self, skeleton: Skeleton) -> Hold | None:
        """The same, as far as it has been asked for before: takes no time."""
        if not any(self._known.values()):
            return None
        return next((hold for hold in self._holds(skeleton) if self._known.get(hold)), None)

    def out_of_reach(self, hold: Hold) -> bool:
        """Whether the arm cannot do it, collisions aside; boxes too wide for the fingers aside."""
        if hold not in self._known:
            limb = self._limbs[hold.gripper]
            sides = grasp_sides(self._geometry, hold.box, self._arms[hold.gripper].arm)
            if self._turns_freely(hold.box):  # sides turned all around in the region
                sides = tuple(side for side in sides if side.flat) or sides[:1]
            self._known[hold] = (
                limb is not None
                and bool(sides)
                and all(limb.cannot(self._grasp(hold, side)) for side in sides)
            )
        return self._known[hold]

    def never(self, ground: GroundInstruction) -> bool:
        """Whether a body cannot be put on furniture, whatever has happened before."""
        return any(map(self.out_of_reach, self._asked(ground.action, ground.parent, loaded=True)))

    def _holds(self, skeleton: Skeleton) -> Iterator[Hold]:
        """What the last action asks of its arms, where it is known where its body stands."""
        last = self._geometry.domain.bind(skeleton[-1])
        moved, state = self._walked(skeleton[:-1])
        loaded = bool(state.carried_by(last.body))
        if last.parent not in self._arms:
            if last.parent not in moved:
                yield from self._asked(last.action, last.parent, loaded)
        elif last.body not in moved:
            yield from self._asked(last.action, None)
        elif (support := moved[last.body]) is not None:
            yield from self._asked(last.action, support)

    def _held(self, action: Action, support: str | None, loaded: bool = False) -> tuple[Hold, ...]:
        """What an action asks of each arm that holds its body at the contact."""
        ground, found = self._geometry.domain.bind(action), []
        for term in ground.contact:
            if term.name == "hold" and term.symbols[1] == ground.body:
                gripper = term.symbols[0]
                lines = straight_lines(ground.motion)
                own = tuple(line for line in lines if line.gripper == gripper)
                if self._geometry.overhung:  # what comes from above may take a low way instead
                    own = tuple(line for line in own if not line.up)
                found.append(Hold(gripper, ground.body, support, own, loaded))
        return tuple(found)

    def _walk(self, skeleton: Skeleton) -> tuple[dict[str, str | None], State]:
        """Where actions bring what they move, and the state after them.

        The former is the support of what was put alone on one that has not moved, or None.
        """
        if not skeleton:
            return {}, self._geometry.scene.state
        moved, state = self._walked(skeleton[:-1])
        ground = self._geometry.domain.bind(skeleton[-1])
        carried = state.carried_by(ground.body)
        alone = not carried and ground.parent not in moved and ground.parent not in self._arms
        moved = moved | dict.fromkeys(carried) | {ground.body: ground.parent if alone else None}
        return moved, successor(state, ground.action)

    def _turns_freely(self, box: str) -> bool:
        """Whether a box is held the same from all around."""
        return self._geometry.is_round(box) and not self._geometry.movable[box].grasps

    def _grasp(self, hold: Hold, side: GraspSide) -> Grasp:
        """All grasps of the box there on one side, with every value of the arm's first joint."""
        half_height = self._geometry.bodies[hold.box].half[2]
        arm, limb = self._arms[hold.gripper], self._limbs[hold.gripper]
        least, most, gap = _ranges(side, half_height, arm.chain.palm_front)
        low, high, height = self._region(hold)
        turn = np.array([0.0, 0.0, side.turn])
        assert limb is not None
        return Grasp(
            low=np.array([*(low + turn), *least, limb.limits[0, 0]]),
            high=np.array([*(high + turn), *most, limb.limits[0, 1]]),
            height=height,
            half_length=side.half_length,
            half_height=half_height,
            palm=arm.chain.palm_front + gap,
            ends=((0.0, 0.0), *((line.back, line.up) for line in hold.lines)),
        )

    def _region(self, hold: Hold) -> tuple[Array, Array, float]:
        """Least and greatest x, y and yaw of the box, and the height of its centre."""
        x, y, yaw, z = self._geometry.poses[hold.support or hold.box]
        if hold.support is None:
            place, turned = np.array([x, y, yaw]), np.zeros(3)
            turned[2] = np.pi / 2 if self._turns_freely(hold.box) else 0.0
            return place - turned, place + turned, z
        hx, hy, hz = self._geometry.bodies[hold.support].half
        cosine, sine = abs(np.cos(yaw)), abs(np.sin(yaw))
        own = self._geometry.bodies[hold.box].half
        beyond = np.hypot(*own[:2]) if hold.loaded else 0.0
        half = np.array([cosine * hx + sine * hy + beyond, sine * hx + cosine * hy + beyond, 0.0])
        half[2] = np.pi / 2  # turned by half a turn, the same grasps come from the box's other end
        centre = np.array([x, y, 0.0])
        return centre - half, centre + half, z + hz + own[2]


def _ranges(side: GraspSide, half_height: float, palm_front: float) -> tuple[Array, Array, float]:
    """Least and greatest pitch and place of the fingertips, along a side and up, of its grasps.

    The last is the least distance of the palm from the box (m).
    """
    if side.given is None:
        along, up = side.half_length - INSET, half_height - INSET
        return np.array([0.0, -along, -up]), np.array([np.pi, along, up]), PALM_GAP
    pitch, offset, depth = side.given
    cp, sp = np.cos(pitch), np.sin(pitch)
    deepest = side.half_length * abs(cp) + half_height * sp + palm_front + depth
    behind = np.array([deepest, deepest + side.slack])
    places = np.array([-behind * cp - offset * sp, behind * sp - offset * cp])
    off = np.array([GRASP_ANGLE, GRASP_OFFSET, GRASP_OFFSET])
    least, most = places.min(axis=1), places.max(axis=1)
    return (
        np.array([pitch, *least]) - off,
        np.array([pitch, *most]) + off,
        depth - GRASP_OFFSET,
    )
