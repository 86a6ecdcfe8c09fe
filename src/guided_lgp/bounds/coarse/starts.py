"""Starts of the solver: placements drawn on their supports, grasps by inverse kinematics.

A start chooses, action by action, where boxes are put down and, for each mode of a box in a
gripper, one pitch for which all its configurations have an inverse kinematic solution within the
joint limits. That is most of the work: the solver only has to make it collision-free and exact.
"""

from collections.abc import Callable

import numpy as np

from guided_lgp.bounds.coarse.formulation import Formulation
from guided_lgp.bounds.coarse.solver import Solver
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.program.inverse import start_ik
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import hold


class Starts:
    """Draws starts for one formulation."""

    def __init__(self, geometry: SceneGeometry, solver: Solver) -> None:
        placed = geometry.scene.robot
        self._robot = kinematics_of(placed.description)
        self._ik = start_ik(self._robot, tuple(placed.fixed_values.values()), solver)

    def draw(
        self,
        formulation: Formulation,
        random: Callable[[], np.random.Generator],
        noise: float,
        warm_start: Array | None = None,
    ) -> Array:
        """A start.

        Args:
            formulation: the program.
            random: the generator for placements and choices, always the same one.
            noise: how far from the best candidates the choice may be (0: the best ones).
            warm_start: values of the first variables, which are kept.

        Returns:
            values of the variables, then the constants.
        """
        program = formulation.program
        values = np.concatenate([program.target, formulation.constants])
        kept = 0 if warm_start is None else len(warm_start)
        if warm_start is not None:
            values[:kept] = warm_start
        draft = Draft(
            values,
            program.variables,
            program.lower,
            kept,
            random,
            noise,
            formulation.configurations,
            self._robot,
            self._ik,
        )
        for choice in formulation.choices:
            choice.start(draft)
        for held in formulation.grips:
            hold.start(draft, held)
        return values
