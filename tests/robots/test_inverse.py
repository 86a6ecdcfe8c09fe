"""Inverse kinematics against the forward kinematics that pinocchio confirms."""

import numpy as np
import pytest
from descriptions import ARMS, TIAGO_PRO, ArmDescription

from guided_lgp.robots.chain import Array
from guided_lgp.robots.inverse import InverseKinematics, solvers
from guided_lgp.robots.inverse.solvers import EXACT, Compiled, InNumpy, best_solver

_TARGETS = 500


def reachable(arm: ArmDescription) -> tuple[InverseKinematics, Array, Array | float]:
    """The arm, random configurations (N, n) within its limits, and their redundancy."""
    limits = arm.limits()
    q = np.random.default_rng(1).uniform(*limits.T, (_TARGETS, len(limits)))
    redundancy = 0.0 if arm.redundant is None else q[:, arm.redundant]
    return InverseKinematics(arm.chain, limits, arm.redundant), q, redundancy


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_reachable_poses_are_solved(arm: ArmDescription) -> None:
    solver, q, redundancy = reachable(arm)
    rotation, position = solver.forward(q)
    solutions, valid = solver.inverse(rotation, position, redundancy)
    assert valid.any(axis=1).mean() >= 0.99
    turned, reached = solver.forward(solutions)
    exact = np.abs(reached - position[:, None]).max(axis=-1) < 1e-7
    exact &= np.abs(turned - rotation[:, None]).max(axis=(-1, -2)) < 1e-7
    assert exact[valid].all()
    limits = arm.limits()
    assert np.all((solutions >= limits[:, 0]) & (solutions <= limits[:, 1]), axis=-1)[valid].all()
    if arm.redundant is not None:
        given = np.asarray(redundancy)[:, None] - solutions[..., arm.redundant]
        np.testing.assert_allclose(np.sin(given / 2), 0, atol=1e-12)


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_the_configuration_itself_is_among_the_solutions(arm: ArmDescription) -> None:
    solver, q, redundancy = reachable(arm)
    solutions, valid = solver.inverse(*solver.forward(q), redundancy)
    distance = np.abs(np.sin((solutions - q[:, None]) / 2)).max(axis=-1)
    found = np.where(valid, distance, 1).min(axis=1) < 1e-4
    structure = solver.problem.structure
    assert structure is not None
    assert found.mean() >= (0.93 if structure.misfit > 1e-3 else 0.99)


def test_poses_out_of_reach_have_no_solution() -> None:
    for arm in ARMS.values():
        solver, q, redundancy = reachable(arm)
        rotation, position = solver.forward(q)
        far = position + np.array([5.0, 0, 0])
        _, valid = solver.inverse(rotation, far, redundancy)
        assert not valid.any()
        nearest, missing = solver.nearest(rotation, far, redundancy)
        _, reached = solver.forward(nearest)
        assert np.all(missing >= np.linalg.norm(reached - far[:, None], axis=-1) - 1e-9)


def test_solutions_do_not_depend_on_the_company() -> None:
    for arm in ARMS.values():
        solver, q, redundancy = reachable(arm)
        rotation, position = solver.forward(q)
        together, valid = solver.inverse(rotation, position, redundancy)
        value = np.broadcast_to(np.asarray(redundancy), len(q))
        for i in range(5):
            alone, alone_valid = solver.inverse(rotation[i], position[i], value[i])
            np.testing.assert_array_equal(alone_valid, valid[i])
            np.testing.assert_allclose(alone[alone_valid], together[i][valid[i]], atol=1e-12)


def test_an_arm_without_structure_is_solved_from_fixed_starts() -> None:
    arm = TIAGO_PRO
    limits = arm.limits()
    solver = InverseKinematics(arm.chain, limits, arm.redundant)
    assert solver.problem.structure is None
    q = np.random.default_rng(2).uniform(*limits.T, (50, 7))
    rotation, position = solver.forward(q)
    solutions, valid = solver.inverse(rotation, position, q[:, 0])
    assert valid.any(axis=1).mean() >= 0.95
    again, _ = solver.inverse(rotation, position, q[:, 0])
    np.testing.assert_array_equal(solutions, again)


def test_compiled_and_interpreted_solvers_agree() -> None:
    for arm in (*ARMS.values(), TIAGO_PRO):
        solver, q, _ = reachable(arm)
        assert isinstance(best_solver(solver.problem), Compiled)
        value = np.zeros(len(q)) if arm.redundant is None else q[:, arm.redundant]
        poses = solver.forward(q)
        compiled, missing = best_solver(solver.problem)(*poses, value)
        interpreted, also_missing = InNumpy(solver.problem)(*poses, value)
        exact, also_exact = missing < EXACT, also_missing < EXACT
        assert (exact == also_exact).mean() > 0.995  # Newton's method may fork at the last bit
        both = exact & also_exact
        same = np.abs(np.sin((compiled - interpreted)[both] / 2)).max(axis=-1) < 1e-5
        assert same.mean() > 0.995


def test_without_a_compiler_numpy_takes_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solvers, "_library", lambda: None)
    solver, q, redundancy = reachable(ARMS["panda"])
    assert isinstance(best_solver(solver.problem), InNumpy)
    _, valid = solver.inverse(*solver.forward(q), redundancy)
    assert valid.any(axis=1).mean() >= 0.99


@pytest.mark.parametrize("name", ["panda", "ur5", "baxter"])
def test_a_straight_line_stays_on_its_branch(name: str) -> None:
    arm = ARMS[name]
    solver, q, redundancy = reachable(arm)
    value = np.broadcast_to(np.asarray(redundancy), len(q))
    followed = 0
    for i in range(20):
        rotation, position = solver.forward(q[i])
        line = position + np.linspace(0, 1, 9)[:, None] * [0, 0, 0.04]
        solutions, valid = solver.inverse(rotation, line, value[i])
        for branch in np.flatnonzero(valid[0]):
            path = solver.follow(solutions, valid, int(branch))
            if path is None:
                continue
            followed += 1
            np.testing.assert_array_equal(path[0], solutions[0, branch])
            assert np.abs(np.diff(path, axis=0)).max() < 0.36
            np.testing.assert_allclose(solver.forward(path)[1], line, atol=1e-7)
    assert followed > 20
