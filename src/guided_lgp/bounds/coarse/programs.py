"""The programs of a scene's skeletons: each goes on where that of its prefix ends."""

from functools import cached_property

from guided_lgp.bounds.coarse.formulation import Formulation, Formulator
from guided_lgp.bounds.coarse.variants import Variant, Variants
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.logic import Skeleton

_MARGINS = (
    Margins(),
    Margins(clear=0.0, apart=0.0, beside=0.003),
    Margins(clear=-0.004, apart=-0.01, beside=0.003),
)
"""Comfortable ones, close ones, and such that only the verification limits: starts take turns."""
_KEPT = 400
"""How many programs are kept to go on from: those that an enumeration comes back to, length by
length. One of four actions takes 30 kB, one of 40 takes 0.3 MB."""


class Formulators:
    """Where the programs of the skeletons that were asked for last have come to."""

    def __init__(self, geometry: SceneGeometry, goals: GoalTerms) -> None:
        self.goals = goals
        self._geometry = geometry
        self._kept: dict[tuple[int, Skeleton, Variant], Formulator] = {}
        """Those that were asked for last come last."""

    @cached_property
    def _begun(self) -> list[Formulator]:
        """Made when first needed: few bounds need what users wish."""
        lasting = self.goals.lasting
        return [Formulator(self._geometry, margins, lasting) for margins in _MARGINS]

    def walked(self, margins: int, skeleton: Skeleton, variant: Variant) -> Formulator:
        """After a skeleton, with the margins of this number."""
        if not skeleton:
            return self._begun[margins]
        key = margins, skeleton, variant
        found = self._kept.pop(key, None) or self._walk(*key)
        self._kept[key] = found
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return found

    def _walk(self, margins: int, skeleton: Skeleton, variant: Variant) -> Formulator:
        before, action = skeleton[:-1], skeleton[-1]
        prefix = self.walked(margins, before, variant.until(len(before)))
        return prefix.after(action, *variant.at(len(before)))


class Programs:
    """The programs of a skeleton, by margins and variant, built when a start needs them."""

    def __init__(
        self,
        formulators: Formulators,
        geometry: SceneGeometry,
        skeleton: Skeleton,
        goals: GoalTerms,
    ) -> None:
        self.skeleton = skeleton
        self.goals = goals
        self.variants = Variants(geometry, skeleton)
        self._formulators = formulators
        self._built: dict[tuple[int, Variant], Formulation] = {}

    def built(self, number: int, variant: Variant) -> Formulation:
        """The program that a start solves."""
        key = number % len(_MARGINS), variant
        if key not in self._built:
            self._built[key] = self._build(*key)
        return self._built[key]

    def _build(self, margins: int, variant: Variant) -> Formulation:
        """Where goals want a body at the end, its last action knows; so there is no prefix then."""
        if self.goals.final:
            begun = self._formulators.walked(margins, (), Variant())
            return begun.build(self.skeleton, variant, self.goals.final)
        return self._formulators.walked(margins, self.skeleton, variant).formulation()
