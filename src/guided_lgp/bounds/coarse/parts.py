"""The coarse bound of parts of a scene: some of its boxes, and what a sequence does with them.

Leaving out boxes, with all actions on them, only takes constraints away. So a sequence is
infeasible if such a part of it is.
"""

from collections.abc import Mapping
from copy import copy

from guided_lgp.bounds.coarse.bound import CoarseBound
from guided_lgp.bounds.coarse.facts import Facts
from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.bounds.results import Array, CoarseResult
from guided_lgp.logic import Skeleton, successor
from guided_lgp.poses import pose
from guided_lgp.scene import Scene
from guided_lgp.scene.world import Placement, World, world_of

Boxes = frozenset[str]


def projected(skeleton: Skeleton, scene: Scene, boxes: Boxes) -> Skeleton:
    """The actions of a sequence that move one of some boxes."""
    bind = scene.symbols.domain.bind
    return tuple(action for action in skeleton if bind(action).body in boxes)


def stacked_with(skeleton: Skeleton, scene: Scene, box: str) -> Boxes:
    """The box, and all that is ever in one stack with it, directly or through others.

    Left out, they would take from it a support, or a counterweight.
    """
    names, links, state = {box.name for box in scene.movable}, set[Boxes](), scene.state
    for action in (None, *skeleton):
        state = state if action is None else successor(state, action)
        links |= {frozenset(pair) for pair in state.support if names.issuperset(pair)}
    found = frozenset({box})
    while (wider := found.union(*(link for link in links if link & found))) != found:
        found = wider
    return found


class Parts:
    """P_coarse of the parts of one scene, each verdict computed once."""

    def __init__(
        self, scene: Scene, restarts: int, facts: Facts, deadline: Deadline = NEVER
    ) -> None:
        self._scene, self._restarts, self._facts = scene, restarts, facts
        self._deadline = deadline
        self._bounds: dict[Boxes, CoarseBound] = {}
        self._known: dict[tuple[Boxes, Skeleton], CoarseResult] = {}

    def solve(self, boxes: Boxes, skeleton: Skeleton) -> CoarseResult:
        """The verdict on a sequence in the scene with no other boxes than these.

        Args:
            boxes: closed under :func:`stacked_with`.
            skeleton: what is done with them, at least one action; see :func:`projected`.
        """
        known = self._known.get((boxes, skeleton))
        if known is None:
            prefix = self.solve(boxes, skeleton[:-1]) if len(skeleton) > 1 else None
            known = self._bound(boxes).solve(skeleton, prefix)
            self._known[boxes, skeleton] = known
        return known

    def _bound(self, boxes: Boxes) -> CoarseBound:
        if boxes not in self._bounds:
            kept = tuple(b for b in self._scene.boxes if b.fixed or b.name in boxes)
            part = self._scene.model_copy(update={"boxes": kept})
            self._bounds[boxes] = CoarseBound(
                part,
                self._restarts,
                deadline=self._deadline,
                facts=self._facts,
                world=_PartOfWorld(world_of(self._scene), part),
            )
        return self._bounds[boxes]


class _PartOfWorld(World):
    """A scene's world with some of its boxes put out of the way: loading another takes 0.3 s."""

    def __init__(self, whole: World, part: Scene) -> None:
        self.__dict__.update(copy(whole).__dict__)
        self._whole = whole  # whose client it is
        self.scene = part
        kept = {box.name for box in part.boxes}
        self._parked = {
            name: pose((0.0, 0.0, -_DEPTH * number)).tolist()
            for number, name in enumerate(self.boxes, 1)
            if name not in kept
        }

    def set(
        self,
        q: Array,
        boxes: Mapping[str, Placement],
        fingers: Mapping[str, float] | None = None,
    ) -> None:
        super().set(q, {**self._parked, **boxes}, fingers)


_DEPTH = 20.0
"""How far (m) below the floor, each below the other: no scene reaches further than 10 m."""
