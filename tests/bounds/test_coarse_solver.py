"""The kernels' derivatives, the two solvers, and the compilation."""

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from guided_lgp import cache, compiled
from guided_lgp.bounds.coarse import compiler, solver
from guided_lgp.bounds.coarse.formulation import Formulator
from guided_lgp.bounds.coarse.solver import Compiled, Interpreter, Settings
from guided_lgp.bounds.coarse.starts import Starts
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.bounds.program.inverse import INPUTS, Grid
from guided_lgp.bounds.program.kernels import Kernel
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.terms import kernel_table
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_skeleton
from guided_lgp.robots import load_robot, robot_names
from guided_lgp.scene import generate


def _compiled() -> Compiled:
    library = compiler.load_library(load_robot("pr2"))
    assert library is not None
    return Compiled(library, load_robot("pr2"))


@pytest.mark.parametrize("robot", robot_names())
def test_jacobians_agree_with_finite_differences(robot: str) -> None:
    for kernel in kernel_table(kinematics_of(load_robot(robot))):
        rng = np.random.default_rng(0)
        for _ in range(5):
            _assert_jacobian(kernel, rng)


def _assert_jacobian(kernel: Kernel, rng: np.random.Generator) -> None:
    x = rng.uniform(-1, 1, kernel.inputs)
    p = rng.uniform(0.1, 0.5, kernel.parameters)
    c, transposed = (np.array(part) for part in kernel.jacobian(x, p))
    assert c.ravel() == pytest.approx(np.array(kernel.residual(x, p)).ravel())
    for j, unit in enumerate(np.eye(kernel.inputs)):
        ahead, behind = (np.array(kernel.residual(x + h * unit, p)) for h in (1e-6, -1e-6))
        expected = (ahead - behind).ravel() / 2e-6
        assert transposed[j] == pytest.approx(expected, abs=1e-5), kernel.name


@pytest.mark.parametrize("robot", robot_names())
def test_what_instances_share_gives_the_same_bytes(robot: str) -> None:
    rng, found = np.random.default_rng(1), 0
    for kernel in kernel_table(kinematics_of(load_robot(robot))):
        for _ in range(20 if kernel.shared else 0):
            x, p = rng.uniform(-2, 2, kernel.inputs), rng.uniform(-1, 1, kernel.parameters)
            others = x.copy(), p.copy()
            others[0][kernel.shared.inputs :] = np.nan
            others[1][kernel.shared.parameters :] = np.nan
            apart = kernel.shared.rows(x, p, kernel.shared.values(*others))
            assert np.array(apart).tobytes() == np.array(kernel.residual(x, p)).tobytes()
            found += 1
    assert found


def test_rows_change_by_no_more_than_their_levers_say() -> None:
    scene = generate("a", 1, 11, "x").scenes[0]
    skeleton = parse_skeleton("(grasp pr2L red) (place pr2L red green) (grasp pr2R green)")
    formulation = Formulator(SceneGeometry(scene), Margins()).build(skeleton)
    program, rng = formulation.program, np.random.default_rng(5)
    interpreter, known = Interpreter(load_robot("pr2")), np.isfinite(program.levers)
    assert known.mean() > 0.5
    low, high = program.lower[: program.variables], program.upper[: program.variables]
    for spread in (1e-3, 0.1, 1.0):
        values = np.concatenate([rng.uniform(low, high), formulation.constants])
        moved = values.copy()
        moved[: program.variables] += rng.normal(scale=spread, size=program.variables)
        change = interpreter.residuals(program, moved) - interpreter.residuals(program, values)
        ways = program.levers * np.abs(moved - values)[program.inputs]
        for i in range(program.instances):
            inputs, rows = (slice(*at[i : i + 2]) for at in program.starts[::2])
            if known[inputs].all():
                assert np.abs(change[rows]).max() <= ways[inputs].sum() + 1e-9


@pytest.mark.parametrize(
    "skeleton",
    [
        "(grasp pr2L red) (place pr2L red tab1)",
        "(grasp pr2L red) (place pr2L red green) (grasp pr2R green)",
        "(grasp pr2L red) (grasp pr2R blue) (place pr2R blue red)",
    ],
)
def test_compiled_and_interpreted_loops_agree(skeleton: str) -> None:
    scene = generate("a", 1, 11, "x").scenes[0]
    geometry, settings = SceneGeometry(scene), Settings(steps=12)
    formulation = Formulator(geometry, Margins()).build(parse_skeleton(skeleton))
    fast, slow = _compiled(), Interpreter(load_robot("pr2"))
    rng = np.random.default_rng(3)
    start = Starts(geometry, fast).draw(formulation, lambda: rng, noise=0.3)
    one = fast.solve(formulation.program, start, settings)
    other = slow.solve(formulation.program, start, settings)
    assert one.steps == other.steps
    assert one.violation == pytest.approx(other.violation, abs=1e-7)
    assert one.values == pytest.approx(other.values, abs=1e-6)
    sizes = {"candidates": (20, INPUTS), "grasp": 5, "poses": (3, 4), "pitches": 2, "ends": (3, 2)}
    grid = Grid(**{name: rng.uniform(-0.5, 0.5, size) for name, size in sizes.items()})
    assert fast.least_costs("0", grid) == pytest.approx(slow.least_costs("0", grid), abs=1e-9)
    for extra in (np.zeros(20), *rng.exponential(0.3, (5, 20))):
        mine, its = (solver.hold("0", grid, extra) for solver in (fast, slow))
        assert mine == pytest.approx(its, abs=1e-9)


def test_variables_stay_within_their_bounds() -> None:
    scene = generate("a", 1, 12, "x").scenes[0]
    geometry = SceneGeometry(scene)
    formulation = Formulator(geometry, Margins()).build(parse_skeleton("(grasp pr2R red)"))
    program = formulation.program
    start = np.concatenate([program.target, formulation.constants])
    values = _compiled().solve(program, start, Settings()).values[: program.variables]
    assert np.all(values >= program.lower)
    assert np.all(values <= program.upper)


# One line per compilation; takes a while, as a compiler does.
COMPILER = """#!/bin/sh
echo compiled >> {log}
while [ "$1" != -o ]; do shift; done
sleep 1
cp {library} "$2"
"""


def test_of_two_processes_one_compiles_and_the_other_waits(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert compiler.load_library(load_robot("pr2")) is not None
    library = next(cache.cache_folder().glob("coarse-*.so"))
    stand_in = tmp_path / "bin" / "cc"
    stand_in.parent.mkdir()
    stand_in.write_text(COMPILER.format(log=tmp_path / "log", library=library))
    stand_in.chmod(0o755)
    monkeypatch.setenv("PATH", str(stand_in.parent), prepend=":")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    code = """
from guided_lgp.bounds.coarse.compiler import load_library
from guided_lgp.robots import load_robot, robot_names
assert load_library(load_robot("pr2"))
"""
    both = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(2)]
    assert [process.wait(60) for process in both] == [0, 0]
    assert compiler.load_library(load_robot("pr2")) is not None
    assert (tmp_path / "log").read_text().count("compiled") == 1
    assert not list((tmp_path / "cache" / "guided-lgp").glob(".unfinished*"))


def test_a_cache_folder_that_cannot_be_written_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert load_robot("pr2").urdf.is_file()  # cached before its folder is taken away
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InputError, match=r"guided-lgp: .*XDG_CACHE_HOME"):
        compiler.load_library(load_robot("pr2"))


def test_without_a_compiler_the_interpreter_takes_over_and_says_so_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert load_robot("pr2").urdf.is_file()  # cached before its folder is taken away
    monkeypatch.setattr(compiled, "find_spec", lambda name: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    solver.default_solver.cache_clear()
    try:
        with caplog.at_level(logging.WARNING):
            assert isinstance(solver.default_solver(load_robot("pr2")), Interpreter)
            solver.default_solver(load_robot("pr2"))
        assert [record.message.count("no C compiler") for record in caplog.records] == [1]
    finally:
        solver.default_solver.cache_clear()
