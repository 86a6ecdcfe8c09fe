"""What an objective adds to the geometry of a plan: terms at its end, and all the time."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from guided_lgp.bounds.checks import Pose, Violation, box_sizes, top_of
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import find_term
from guided_lgp.bounds.terms.term import GoalTerm
from guided_lgp.logic import Domain, GroundTerm, Objective
from guided_lgp.scene import Scene


@dataclass(frozen=True)
class GoalTerms:
    """The terms of an objective; an objective of symbols alone has none."""

    final: tuple[GroundTerm, ...] = ()
    """On bodies, at the end."""
    lasting: tuple[GroundTerm, ...] = ()
    """All the time."""
    postures: tuple[GroundTerm, ...] = ()
    """On arms, at the end."""

    @classmethod
    def of(cls, objective: Objective, domain: Domain) -> "GoalTerms":
        """The terms of all goals."""
        return cls(
            tuple(term for goal in objective for term in domain.final_terms(goal)),
            tuple(term for goal in objective for term in domain.lasting_terms(goal)),
            tuple(term for goal in objective for term in domain.posture_terms(goal)),
        )

    @property
    def upright(self) -> frozenset[str]:
        """The boxes that stay level on their way."""
        return frozenset(term.symbols[0] for term in self.lasting if find_term(term.name).levels)

    @property
    def ends(self) -> dict[str, Array]:
        """The joints (n,) at which arms end, by gripper."""
        return {
            term.symbols[0]: np.array([float(value) for value in term.options.values()])
            for term in self.postures
        }

    def firmer(self, grippers: Iterable[str]) -> tuple["GoalTerms", "GoalTerms"]:
        """These with what plans for users wish: no load turns what grippers hold; and besides,
        nothing stands only by what it carries.
        """
        steady = tuple(GroundTerm("steady", (gripper,)) for gripper in grippers)
        wishes = steady, (*steady, GroundTerm("unaided", ()))
        held, unaided = (replace(self, lasting=(*self.lasting, *wish)) for wish in wishes)
        return held, unaided

    def about(self, box: str) -> "GoalTerms":
        """Those at the end that are about one box."""
        return GoalTerms(tuple(term for term in self.final if term.symbols[0] == box))

    def faults(self, scene: Scene, boxes: Mapping[str, Array]) -> list[Violation]:
        """Which terms do not hold where boxes, at poses (7,) in the world, are at the end."""
        if not self.final:
            return []
        poses: dict[str, Pose] = {name: pose.tolist() for name, pose in boxes.items()}
        sizes, found = box_sizes(scene), list[Violation]()
        for term in self.final:
            goal, (box, support) = find_term(term.name), term.symbols
            assert isinstance(goal, GoalTerm)
            top = top_of(scene, poses, support)
            excess = goal.check(sizes[box], poses[box], top, **term.options)
            if excess > 0:
                found.append(Violation(f"{term.name} {box} {support}", excess))
        return found


NO_TERMS = GoalTerms()
