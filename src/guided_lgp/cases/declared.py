"""A case as ``cases:`` in ``params.yaml`` declares it, checked before anything is computed."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from guided_lgp.cases.policies import FULL, SIGHTS
from guided_lgp.domains import domain_names
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.logic import Objective
from guided_lgp.params import Case, Params
from guided_lgp.paths import PARAMS
from guided_lgp.robots import load_robot
from guided_lgp.scene import Scene
from guided_lgp.scene.families import Drawn, Family, draw_problems, find_family
from guided_lgp.scene.families.family import Layout
from guided_lgp.scene.model import PlacedRobot


@dataclass(frozen=True)
class Source:
    """Where problems come from: a family, and its numbers."""

    family: Family
    layout: Layout


@dataclass(frozen=True)
class DeclaredCase:
    """A case with all that its names stand for."""

    name: str
    params: Case
    trained_on: Source
    tested_on: Source

    def training(self) -> Iterator[tuple[Scene, list[Objective]]]:
        """The scenes of the demonstrations, each with what is wanted there."""
        wanted, source = self.params.demonstrations, self.trained_on
        drawn = self._drawn(source, "training", wanted.size, wanted.scenes, wanted.seed)
        for index, one in enumerate(drawn):
            rng = np.random.default_rng(np.random.SeedSequence((wanted.seed, index)))
            yield one.scene, source.family.training_objectives(one.scene, rng)

    def problems(self, size: int) -> list[Drawn]:
        """The problems of one size of the test set."""
        wanted = self.params.evaluation
        return self._drawn(self.tested_on, "test", size, wanted.scenes, wanted.seed)

    def _drawn(self, source: Source, purpose: str, size: int, count: int, seed: int) -> list[Drawn]:
        prefix = f"{self.name}-{purpose}-{size}"
        found = draw_problems(source.family, source.layout, size, count, seed, prefix)
        robot = PlacedRobot(model=self.params.robot)
        update = {"domain": self.params.domain, "robot": robot}
        return [Drawn(one.scene.model_copy(update=update), one.objective) for one in found]


def declared_case(params: Params, name: str) -> DeclaredCase:
    """One case, checked.

    Raises:
        InputError: there is no such case, or it names a domain, robot, family, number of a family
            or control that does not exist.
    """
    if name not in params.cases:
        accepted = ", ".join(params.cases) or "none is declared"
        raise InputError("case", f"unknown case {name!r}", accepted)
    case, where = params.cases[name], f"{PARAMS}: cases.{name}"
    if case.domain not in domain_names():
        fault = f"unknown domain {case.domain!r}"
        raise InputError(f"{where}.domain", fault, ", ".join(domain_names()))
    load_robot(case.robot)
    tested_on = _source(case, case.family, where, "family")
    trained_on = _source(case, case.demonstrations.family, where, "demonstrations.family")
    controls = [control for control in SIGHTS if control != FULL]
    for control in case.controls:
        if control not in controls:
            raise InputError(f"{where}.controls", f"unknown {control!r}", ", ".join(controls))
    return DeclaredCase(name, case, trained_on, tested_on)


def _source(case: Case, family: str, where: str, key: str) -> Source:
    found = find_family(family, f"{where}.{key}")
    return Source(found, validated(found.layout.model_validate, case.layout, f"{where}.layout"))
