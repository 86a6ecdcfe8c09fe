"""Where the acting hand may be at the contact of an action: at the body, or to put it down."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from guided_lgp.bounds.path.foresight import Foresight
from guided_lgp.bounds.path.grips import Grips
from guided_lgp.bounds.path.loads import price_of_grips, price_of_places
from guided_lgp.bounds.path.placing import STRATEGIES, PlacementSampler
from guided_lgp.bounds.path.situation import Situation
from guided_lgp.bounds.path.task import Task
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, rotation_matrix


@dataclass(frozen=True)
class Contacts:
    """N tool poses at a contact."""

    rotation: Array
    """(N, 3, 3) of the tool frame."""
    position: Array
    """(N, 3) of its origin (m)."""
    way: Array
    """(N, 3) from there to where the straight way in begins (m)."""
    cost: Array
    """(N,) what the rest of the skeleton adds to the cost of each."""
    possible: Callable[[int], bool]
    """Whether the rest of the skeleton allows it."""


class ContactSampler:
    """Generates the contacts of the actions of one task, the likeliest first."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._placements = PlacementSampler(task)
        self._foresight = Foresight(task, self._placements)

    def contacts(self, index: int, situation: Situation, width: float | None) -> Iterator[Contacts]:
        """A gripper takes the body where it is, another parent gets it put down on itself.

        Args:
            index: of the action.
            situation: before the contact, the fingers open.
            width: of the body between the fingers (m), if they close on it.
        """
        if width is None:
            return self._places(index, situation)
        return self._grips(index, situation, width)

    def _grips(self, index: int, situation: Situation, width: float) -> Iterator[Contacts]:
        """Ways to hold the body on sides so far apart, for one strategy of its next action after
        the other.
        """
        action = self._task.manoeuvres[index]
        body = action.body
        central, others = self._task.grips[action.parent, body][width]
        given = self._task.boxes[body].grasps
        if not given and width == self._task.widths(index)[0]:
            central += self._coarse_grip(index)
        box = situation.boxes(self._task.arms)[body]
        batches = [batch for batch in (central, others) if len(batch)]  # given grasps are one
        for strategy, grips in product(STRATEGIES, batches):
            outlook = self._foresight.outlook(index, situation, grips, width, strategy)
            if outlook is None:
                continue
            rotation, position = grips.tools(box[:3], rotation_matrix(box[3:]))
            cost = outlook.cost + price_of_grips(self._task, index, grips)
            for way in self._task.manoeuvres[index].way_in.ways:
                yield Contacts(rotation, position, way.of(rotation), cost, outlook.possible)

    def _coarse_grip(self, index: int) -> Grips:
        """The coarse solution's own grip."""
        action, contact = self._task.manoeuvres[index], self._task.contacts[index]
        box = contact.boxes[action.body]
        arm = self._task.arms[action.parent]
        rotation, position = arm.forward(contact.q[arm.arm.slice])
        frame = rotation_matrix(box[3:])
        return Grips((frame.T @ rotation)[None], ((position - box[:3]) @ frame)[None])

    def _places(self, index: int, situation: Situation) -> Iterator[Contacts]:
        """The places of the body, for one strategy after the other."""
        grasp = inverse(situation.carried[self._task.manoeuvres[index].body][1])
        boxes = situation.boxes(self._task.arms)
        for strategy in STRATEGIES:
            places = self._placements.places(index, situation, boxes, strategy)
            if not places:
                continue
            tools = compose(np.array([place.pose for place in places]), grasp)
            rotation = rotation_matrix(tools[:, 3:])
            ways = [place.way.of(turn) for place, turn in zip(places, rotation, strict=True)]
            cost = price_of_places(self._task, index, situation, boxes, places)
            yield Contacts(rotation, tools[:, :3], np.array(ways), cost, lambda pose: True)
