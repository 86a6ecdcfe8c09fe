"""The discrete choices in the program of a skeleton, which starts make in turns.

A grip closes on one of the pairs of sides that the hand can take, or is one of the given grasps.
Below something, a box comes and goes by a low straight way as well as from above.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.program.grasp import grasp_sides
from guided_lgp.logic import Skeleton, State, successor
from guided_lgp.logic.domain import GroundInstruction
from guided_lgp.robots import Arm


@dataclass(frozen=True)
class Variant:
    """What is chosen; the first of each where nothing is said."""

    sides: tuple[int, ...] = ()
    """For each action, on which of the sides that the hand can close on its new grip does."""
    low: tuple[int, ...] = ()
    """For each action, whether its box takes a low way (1) or one from above (0)."""

    def until(self, action: int) -> "Variant":
        """The choices before an action."""
        return Variant(self.sides[:action], self.low[:action])

    def at(self, action: int) -> tuple[int, bool]:
        """The choices of an action: the side, and whether the way is low."""
        side = self.sides[action] if action < len(self.sides) else 0
        return side, action < len(self.low) and self.low[action] == 1


class Variants:
    """The choices that a skeleton leaves."""

    def __init__(self, geometry: SceneGeometry, skeleton: Skeleton) -> None:
        self._geometry, self._skeleton = geometry, skeleton

    @cached_property
    def _grounds(self) -> list[GroundInstruction]:
        return [self._geometry.domain.bind(action) for action in self._skeleton]

    @cached_property
    def _sides(self) -> list[int]:
        arms = self._geometry.scene.robot.description.arms
        return [_side_count(self._geometry, arms.get(g.parent), g) for g in self._grounds]

    @cached_property
    def _low(self) -> list[int]:
        return list(_way_counts(self._geometry, self._grounds))

    def starts(self, least: int) -> int:
        """How many starts try one choice after the other until all have met, or the least number.

        Where places are given, a grip can do what another one cannot at both ends of its way.
        """
        turns = int(np.lcm.reduce([1, *self._sides])) * max(self._low, default=1)
        return max(least, min(2 * turns, _MOST_STARTS))

    def tried(
        self, number: int, random: Callable[[], np.random.Generator], kept: Variant
    ) -> Variant:
        """What a start chooses.

        Args:
            number: of the start.
            random: the generator of every other start, which keeps nothing and draws.
            kept: of the prefix; the last action tries one choice after the other.
        """
        if number and number % 2 == 0:
            return Variant(_drawn(random(), self._sides), _drawn(random(), self._low))
        if number == 0:
            first = (0,) * (len(self._skeleton) - len(kept.sides))
            return Variant(kept.sides + first, kept.low + first)
        turn, new = (number + 1) // 2, self._sides[len(kept.sides) :]
        sides = tuple(turn % count for count in new)
        turn //= max(new, default=1)
        low = tuple(turn % count for count in self._low[len(kept.low) :])
        return Variant(kept.sides + sides, kept.low + low)


_MOST_STARTS = 60
"""Three actions' grips may be five, five and three, and two of the ways low: a second or two."""


def _drawn(generator: np.random.Generator, counts: Sequence[int]) -> tuple[int, ...]:
    return tuple(int(generator.integers(count)) if count > 1 else 0 for count in counts)


def _side_count(geometry: SceneGeometry, arm: Arm | None, ground: GroundInstruction) -> int:
    """On how many sides the grip that an action begins can close; 1 where none is, or it is new."""
    return 1 if arm is None else max(1, len(grasp_sides(geometry, ground.body, arm)))


def _way_counts(geometry: SceneGeometry, grounds: Sequence[GroundInstruction]) -> Iterator[int]:
    """How many straight ways every action's box has."""
    if not geometry.overhung:
        yield from [1] * len(grounds)
        return
    state = geometry.scene.state
    for ground in grounds:
        below = _root(state, ground.body if ground.into_hand else ground.parent)
        yield 2 if below in geometry.overhung else 1
        state = successor(state, ground.action)


def _root(state: State, name: str) -> str:
    """What a body stands on in the end."""
    support = state.support_of(name)
    return name if support is None else _root(state, support)
