"""The nonlinear program in arrays, and the two solvers of it: compiled and interpreted."""

import ctypes
import logging
from dataclasses import astuple, dataclass, fields
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.coarse.compiler import load_library
from guided_lgp.bounds.program.arrays import Program
from guided_lgp.bounds.program.inverse import (
    INPUTS,
    ClosedForms,
    Grid,
    closed_form_arms,
    closed_forms,
)
from guided_lgp.bounds.program.kernels import Kernel, KernelTable
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import kernel_table
from guided_lgp.compiled import address
from guided_lgp.robots import Robot

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Settings:
    """Settings of the augmented Lagrangian; the fields of the structure in C, in its order."""

    penalty: float = 30.0
    growth: float = 2.0
    largest_penalty: float = 1e5
    damping: float = 0.1
    tolerance: float = 1e-3
    """Largest violation of an equality, scaled."""
    slack: float = 1e-2
    """What an inequality may be violated by beyond the tolerance: its margin is larger."""
    steps: int = 200
    inner: int = 2
    patience: int = 25
    """Steps without a gain of 10 % on the violation before giving up."""


@dataclass(frozen=True)
class Solution:
    """Where the solver stopped."""

    values: Array
    """Variables, then constants."""
    residuals: Array
    """(rows,), scaled. Inequalities that had no effect may be those of an earlier step."""
    violation: float
    """Largest violation of a row, scaled; of an inequality, beyond the slack."""
    steps: int

    def converged(self, settings: Settings) -> bool:
        """Whether all rows hold within the tolerance."""
        return self.violation <= settings.tolerance


class Solver(ClosedForms, Protocol):
    """Solves programs and closed-form inverse kinematics."""

    def solve(self, program: Program, values: Array, settings: Settings, kept: int = 0) -> Solution:
        """Solve from a start.

        Args:
            program: the problem.
            values: of the variables, then the constants.
            settings: of the loop.
            kept: how many variables, the first ones, stay where they are.
        """
        ...


_COUNTS = ("variables", "instances", "rows")
_ARRAYS = tuple(field.name for field in fields(Program) if field.name != "sizes")
_FOUND = ("input_start", "parameter_start", "row_start")
"""In C."""


class _CProgram(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in (*_COUNTS, "kept")),
        *((name, ctypes.c_void_p) for name in (*_ARRAYS, *_FOUND)),
    )


class _CSettings(ctypes.Structure):
    _fields_ = tuple(
        (f.name, ctypes.c_int if isinstance(f.default, int) else ctypes.c_double)
        for f in fields(Settings)
    )


class _CGrid(ctypes.Structure):
    _fields_ = (
        ("shape", ctypes.c_int * 4),
        *((name, ctypes.c_void_p) for name in Grid._fields),
    )

    @classmethod
    def of(cls, grid: Grid) -> "_CGrid":
        return cls(grid.shape, *map(address, grid))


@cache
def _in_c(settings: Settings) -> _CSettings:
    return _CSettings(*astuple(settings))


class Compiled:
    """The loop in C with a robot's kernels as machine code."""

    def __init__(self, library: ctypes.CDLL, robot: Robot) -> None:
        self._solve = library.coarse_solve
        self._solve.restype = ctypes.c_int
        self._solve.argtypes = [ctypes.c_void_p] * 5
        self._hold = library.coarse_hold
        self._least_costs = library.coarse_least_costs
        for function in (self._hold, self._least_costs):
            function.restype = None
            function.argtypes = [ctypes.c_int] * 2 + [ctypes.c_void_p] * 3
        arms = closed_form_arms(kinematics_of(robot))
        self._forms = {name: (i, 1 + len(arm.home)) for i, (name, arm) in enumerate(arms.items())}

    def solve(self, program: Program, values: Array, settings: Settings, kept: int = 0) -> Solution:
        """See :class:`Solver`."""
        values = np.array(values, dtype=np.float64)
        residuals = np.empty(program.rows)
        worst = ctypes.c_double()
        header = _CProgram(
            *(getattr(program, name) for name in _COUNTS),
            kept,
            *(address(getattr(program, name)) for name in _ARRAYS),
        )
        steps = self._solve(
            ctypes.addressof(header),
            ctypes.addressof(_in_c(settings)),
            address(values),
            address(residuals),
            ctypes.addressof(worst),
        )
        return Solution(values, residuals, worst.value, steps)

    def hold(self, chain: str, grid: Grid, extra: Array) -> Array:
        """See :class:`ClosedForms`."""
        number, outputs = self._forms[chain]
        joints = np.zeros((len(grid.ends), outputs - 1))
        header = _CGrid.of(grid)
        self._hold(number, outputs, ctypes.addressof(header), address(extra), address(joints))
        return joints

    def least_costs(self, chain: str, grid: Grid) -> Array:
        """See :class:`ClosedForms`."""
        number, outputs = self._forms[chain]
        costs = np.empty((len(grid.poses), len(grid.pitches)))
        header = _CGrid.of(grid)
        self._least_costs(number, outputs, ctypes.addressof(header), None, address(costs))
        return costs


class Interpreter:
    """The same loop in numpy, with the kernels on CasADi's virtual machine."""

    def __init__(self, robot: Robot) -> None:
        self._robot = kinematics_of(robot)
        self._table = kernel_table(self._robot)

    def solve(self, program: Program, values: Array, settings: Settings, kept: int = 0) -> Solution:
        """See :class:`Solver`."""
        n = program.variables
        values = np.array(values, dtype=np.float64)
        program = program.holding(values[:kept])
        equality = equalities(self._table, program)
        penalty, damping, tried = settings.penalty, settings.damping, 0
        multiplier = np.zeros(program.rows)
        c = self.residuals(program, values)
        worst = best = _violation(c, equality, settings.slack)
        improved = 0
        while (
            worst > settings.tolerance
            and tried < settings.steps
            and tried - improved < settings.patience
        ):
            value = _merit(program, values, c, multiplier, penalty, equality)
            for _ in range(settings.inner):
                if tried >= settings.steps:
                    break
                g, H = self._linearise(program, values, c, multiplier, penalty, equality)
                x = values[:n].copy()
                held = ((x <= program.lower) & (g > 0)) | ((x >= program.upper) & (g < 0))
                held |= program.lower == program.upper
                free = ~held
                accepted, gain = False, 0.0
                while not accepted and tried < settings.steps:
                    tried += 1
                    direction = np.zeros(n)
                    damped = H[np.ix_(free, free)] + damping * np.eye(int(free.sum()))
                    direction[free] = np.linalg.solve(damped, -g[free])
                    values[:n] = np.clip(x + direction, program.lower, program.upper)
                    c_new = self.residuals(program, values)
                    trial = _merit(program, values, c_new, multiplier, penalty, equality)
                    if trial < value:
                        accepted, gain, value, c = True, value - trial, trial, c_new
                        damping = max(0.2 * damping, 1e-6)
                    else:
                        values[:n] = x
                        damping *= 5
                        if damping > 1e8:
                            break
                worst = _violation(c, equality, settings.slack)
                if worst < 0.9 * best:
                    best, improved = worst, tried
                if worst <= settings.tolerance or not accepted or gain < 1e-2 * value:
                    break
            damping = min(damping, 1e3)
            multiplier = multiplier - penalty * c
            multiplier = np.where(equality, multiplier, np.maximum(multiplier, 0))
            penalty = min(penalty * settings.growth, settings.largest_penalty)
        return Solution(values, c, worst, tried)

    def hold(self, chain: str, grid: Grid, extra: Array) -> Array:
        """See :class:`ClosedForms`."""
        solutions = self._solutions(chain, grid)[0, 0]
        costs = solutions[..., -1].sum(axis=0) + extra
        return np.asarray(solutions[:, costs.argmin(), :-1])

    def least_costs(self, chain: str, grid: Grid) -> Array:
        """See :class:`ClosedForms`."""
        return np.asarray(self._solutions(chain, grid)[..., -1].sum(axis=2).min(axis=2))

    def _solutions(self, chain: str, grid: Grid) -> Array:
        """Joints, then the cost, of all candidates (N, M, E, C, n + 1)."""
        form, arguments = closed_forms(self._robot)[chain], grid.arguments().reshape(-1, INPUTS)
        return np.array(form.map(len(arguments))(arguments.T)).T.reshape(*grid.shape, -1)

    def _arguments(self, program: Program, i: int, values: Array) -> tuple[Kernel, Array, Array]:
        kernel = self._table[program.kernel[i]]
        input_start, parameter_start, _ = program.starts[:, i]
        inputs = program.inputs[input_start:][: kernel.inputs]
        return kernel, values[inputs], program.parameters[parameter_start:][: kernel.parameters]

    def residuals(self, program: Program, values: Array) -> Array:
        """All rows (scaled) at values of the variables and constants."""
        parts = []
        for i in range(program.instances):
            kernel, x, p = self._arguments(program, i, values)
            parts.append(np.array(kernel.residual(x, p)).ravel())
        return np.concatenate(parts)

    def _linearise(
        self,
        program: Program,
        values: Array,
        c: Array,
        multiplier: Array,
        penalty: float,
        equality: NDArray[np.bool_],
    ) -> tuple[Array, Array]:
        n = program.variables
        shifted = c - multiplier / penalty
        active = equality | (shifted < 0)
        g = program.weight * (values[:n] - program.target)
        H = np.diag(program.weight)
        for i in range(program.instances):
            input_start, _, row_start = program.starts[:, i]
            rows = slice(row_start, program.starts[2, i + 1])
            if not active[rows].any():
                continue
            kernel, x, p = self._arguments(program, i, values)
            inputs = program.inputs[input_start:][: kernel.inputs]
            variable = inputs < n
            jacobian = np.array(kernel.jacobian(x, p)[1]).T[active[rows]][:, variable]
            g_part = penalty * jacobian.T @ shifted[rows][active[rows]]
            np.add.at(g, inputs[variable], g_part)
            np.add.at(
                H, np.ix_(inputs[variable], inputs[variable]), penalty * jacobian.T @ jacobian
            )
        return g, H


def equalities(table: KernelTable[Kernel], program: Program) -> NDArray[np.bool_]:
    """Which rows (rows,) are equalities."""
    return np.concatenate([np.full(table[k].rows, table[k].equality) for k in program.kernel])


def _violation(c: Array, equality: NDArray[np.bool_], slack: float) -> float:
    return float(np.max(np.where(equality, np.abs(c), -c - slack), initial=0.0))


def _merit(
    program: Program,
    values: Array,
    c: Array,
    multiplier: Array,
    penalty: float,
    equality: NDArray[np.bool_],
) -> float:
    shifted = c - multiplier / penalty
    shifted = np.where(equality, shifted, np.minimum(shifted, 0))
    deviation = values[: program.variables] - program.target
    return 0.5 * float(program.weight @ deviation**2 + penalty * shifted @ shifted)


@cache
def default_solver(robot: Robot) -> Solver:
    """The compiled solver, or the interpreted one where there is no C compiler (said once)."""
    library = load_library(robot)
    if library is not None:
        return Compiled(library, robot)
    _log.warning(
        "no C compiler found (cc, gcc, clang or the package ziglang): the coarse bound runs "
        "on CasADi's virtual machine, with the same verdicts, about a hundred times slower"
    )
    return Interpreter(robot)
