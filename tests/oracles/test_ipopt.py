"""IPOPT on the same nonlinear programs: an independent judge of the compiled solver."""

from functools import cache, partial

import numpy as np
import pytest

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.formulation import Formulation, Formulator
from guided_lgp.bounds.coarse.ipopt import Ipopt
from guided_lgp.bounds.coarse.solver import Settings, Solution, default_solver
from guided_lgp.bounds.coarse.starts import Starts
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.logic import parse_skeleton
from guided_lgp.robots import load_robot
from guided_lgp.scene import Box, Scene, Table

SCENE = Scene(
    tables=(
        Table(name="tab1", position=(0.54, 0.33, 0.6), half_extents=(0.17, 0.2)),
        Table(name="tab2", position=(0.54, -0.33, 0.6), half_extents=(0.17, 0.2)),
    ),
    boxes=(
        Box(name="red", size=(0.15, 0.07, 0.1), position=(0.5, 0.25, 0.65), yaw=0.4, on="tab1"),
        Box(name="far", size=(0.15, 0.07, 0.1), position=(0.62, 0.48, 0.65), on="tab1"),
    ),
)
SETTINGS = Settings()


REACHABLE = (
    "(grasp pr2L red)",
    "(grasp pr2L far)",
    "(grasp pr2R red)",
    "(grasp pr2L red) (place pr2L red tab1)",
    "(grasp pr2L far) (place pr2L far red)",
)
OUT_OF_REACH = "(grasp pr2R far)"
_STARTS = 3


def _oracle(skeleton: str) -> tuple[Formulation, Solution]:
    """IPOPT's best point of a few starts."""
    geometry = SceneGeometry(SCENE)
    formulation = Formulator(geometry, Margins()).build(parse_skeleton(skeleton))
    starts = Starts(geometry, default_solver(load_robot("pr2")))
    solutions = []
    oracle = None
    for seed in range(_STARTS):
        start = starts.draw(
            formulation, cache(partial(np.random.default_rng, seed)), noise=0.1 * seed
        )
        oracle = oracle or Ipopt(load_robot("pr2"), formulation.program, start, SETTINGS)
        solutions.append(oracle.solve(start))
        if solutions[-1].converged(SETTINGS):
            break
    return formulation, min(solutions, key=lambda solution: solution.violation)


@pytest.mark.parametrize("skeleton", REACHABLE)
def test_ipopt_finds_the_sequences_feasible_that_the_bound_does(skeleton: str) -> None:
    assert CoarseBound(SCENE, 9).solve(parse_skeleton(skeleton)).feasible
    formulation, theirs = _oracle(skeleton)
    assert theirs.violation <= SETTINGS.tolerance
    # and its point is one for our solver: nothing is left to do from there
    ours = default_solver(load_robot("pr2")).solve(formulation.program, theirs.values, SETTINGS)
    assert ours.steps == 0


def test_ipopt_agrees_that_a_box_out_of_reach_is_out_of_reach() -> None:
    result = CoarseBound(SCENE, 9).solve(parse_skeleton(OUT_OF_REACH))
    assert result.failure is not None
    assert result.failure.constraint == "hold pr2R far"
    _, theirs = _oracle(OUT_OF_REACH)
    assert theirs.violation > 10 * SETTINGS.tolerance
