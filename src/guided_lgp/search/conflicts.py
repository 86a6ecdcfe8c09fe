"""Conflicts: the smallest part of an infeasible sequence that is infeasible alone.

A part is some boxes with all that the sequence does with them, the others being absent. Leaving
out boxes only takes constraints away, so whatever does the same with these boxes is infeasible in
any context (compare Ortiz-Haro et al., ICAPS 2022).
"""

from dataclasses import dataclass

from guided_lgp.bounds.coarse.parts import Boxes, projected, stacked_with
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Action, Skeleton
from guided_lgp.scene import Scene
from guided_lgp.scene.footprints import footprint, gap
from guided_lgp.search.result import Run


@dataclass(frozen=True)
class Conflict:
    """What cannot be done with some boxes, whatever happens to all others."""

    boxes: Boxes
    actions: Skeleton


class Conflicts:
    """The conflicts found so far, as knowledge for a search; parts are calls of its run."""

    def __init__(self, scene: Scene, run: Run | SceneBounds) -> None:
        self._scene, self._run = scene, run
        self._bind = scene.symbols.domain.bind
        self.found: list[Conflict] = []

    def learn(self, skeleton: Skeleton) -> None:
        """Find the conflict in an infeasible sequence; all but its last action is feasible.

        First the box of the last action alone, then with one other, the nearest first; then
        everything, of which one after the other is left out.
        """
        every = Boxes(box.name for box in self._scene.movable)
        own, others = self._stacks(skeleton)
        small = [own, *(own | other for other in others)]
        boxes = next((part for part in small if self._infeasible(part, skeleton)), every)
        if boxes == every:
            for other in others:
                if len(others) > 1 and self._infeasible(boxes - other, skeleton):
                    boxes -= other
        self.found.append(Conflict(boxes, projected(skeleton, self._scene, boxes)))

    def denied(self, skeleton: Skeleton) -> bool:
        """Whether a sequence does with some boxes what is a conflict."""
        return any(self._contains(skeleton, conflict) for conflict in self.found)

    def blockers(self, action: Action) -> tuple[Boxes, ...]:
        """The other boxes of the conflicts of one action."""
        body = self._bind(action).body
        own = stacked_with((action,), self._scene, body)
        return tuple(found.boxes - own for found in self.found if found.actions == (action,))

    def _stacks(self, skeleton: Skeleton) -> tuple[Boxes, list[Boxes]]:
        """What moves in the last action, with its stack, and the other stacks, nearest first."""
        body = self._bind(skeleton[-1]).body
        stacks = {
            stacked_with(skeleton, self._scene, box.name): None
            for box in sorted(self._scene.movable, key=lambda box: self._distance(body, box.name))
        }
        own = stacked_with(skeleton, self._scene, body)
        return own, [stack for stack in stacks if stack != own]

    def _distance(self, one: str, other: str) -> float:
        places = {box.name: footprint(box) for box in self._scene.movable}
        return gap(places[one], places[other])

    def _infeasible(self, boxes: Boxes, skeleton: Skeleton) -> bool:
        return not self._run.part(boxes, projected(skeleton, self._scene, boxes)).feasible

    def _contains(self, skeleton: Skeleton, conflict: Conflict) -> bool:
        done = projected(skeleton, self._scene, conflict.boxes)
        same = done[: len(conflict.actions)] == conflict.actions
        return same and all(
            stacked_with(skeleton, self._scene, box) <= conflict.boxes for box in conflict.boxes
        )
