"""Facts of pairs: which neighbours, where they stand at the start, keep an arm from a box.

A fact is the verdict of the coarse bound on one action in the scene with the two boxes alone. What
is impossible there is impossible in any context, as long as both are where they were: other boxes
only ever add constraints.
"""

from collections.abc import Callable, Iterator

import numpy as np

from guided_lgp.bounds.coarse.parts import Boxes, stacked_with
from guided_lgp.bounds.results import CoarseResult, Failure
from guided_lgp.logic import Action, Skeleton, successor
from guided_lgp.scene import Scene
from guided_lgp.scene.footprints import footprint, gap

_NEAR = 0.12
"""How far (m) beside a box something is asked about: an open hand is not as wide."""

Ask = Callable[[Skeleton], CoarseResult]
AskPart = Callable[[Boxes, Skeleton], CoarseResult]


class Pairs:
    """The facts of pairs of one scene, each found when it is first asked for.

    Args:
        scene: the scene.
        whole: verdicts of its coarse bound.
        part: verdicts with some boxes alone; see :class:`~guided_lgp.bounds.coarse.parts.Parts`.
    """

    def __init__(self, scene: Scene, whole: Ask, part: AskPart) -> None:
        self._scene, self._whole, self._part = scene, whole, part
        self._bind = scene.symbols.domain.bind
        self._near = _neighbours(scene)
        self._known: dict[Action, tuple[Boxes, ...]] = {}

    def blockers(self, action: Action) -> tuple[Boxes, ...]:
        """What makes an action on a box at its start impossible while all of it is at its start.

        Args:
            action: one that is applicable at the start.

        Returns:
            Sets of other boxes, each of which suffices: an empty one if the arm cannot do it even
            with the box alone, else the neighbours (each with its stack) that are in the way;
            nothing if the action is possible, if several of them are in the way together, or if the
            box carries others, which may have left it.
        """
        if action not in self._known:
            self._known[action] = tuple(self._found(action))
        return self._known[action]

    def _found(self, action: Action) -> Iterator[Boxes]:
        if self._scene.state.carried_by(self._bind(action).body) or self._whole((action,)).feasible:
            return
        own = stacked_with((action,), self._scene, self._bind(action).body)
        if not self._part(own, (action,)).feasible:
            yield Boxes()
            return
        others = {stacked_with((action,), self._scene, name) for name in self._near_to(own)}
        for other in sorted(others - {own}, key=sorted):
            if not self._part(own | other, (action,)).feasible:
                yield other

    def _near_to(self, boxes: Boxes) -> set[str]:
        return {name for box in boxes for name in self._near[box]}

    def impossible(self, skeleton: Skeleton) -> Failure | None:
        """What makes the last action of a sequence impossible, as far as facts of pairs go."""
        *before, last = skeleton
        if not self._bind(last).into_hand or self._known.get(last) == ():
            return None
        moved = self._moved(tuple(before))
        if self._bind(last).body in moved:
            return None
        for boxes in self.blockers(last):
            if not boxes & moved:
                fault = " ".join((str(last)[1:-1], *sorted(boxes)))
                return Failure(len(before), fault, np.nan, _PROVED)
        return None

    def _moved(self, skeleton: Skeleton) -> set[str]:
        """What actions move, directly or with what it stands on."""
        moved, state = set[str](), self._scene.state
        for action in skeleton:
            body = self._bind(action).body
            moved |= {body, *state.carried_by(body)}
            state = successor(state, action)
        return moved


_PROVED = "infeasible in the scene of these boxes alone"
"""What was tried where a fact says no."""


def _neighbours(scene: Scene) -> dict[str, set[str]]:
    places = {box.name: footprint(box) for box in scene.movable}
    return {
        name: {other for other in places if other != name and gap(place, places[other]) <= _NEAR}
        for name, place in places.items()
    }
