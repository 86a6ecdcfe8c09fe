"""Kernels: the symbolic form of one kind of constraint, with its derivatives.

A program is a list of instances: a kernel, where in the vector of values its arguments stand, and
its parameters. Nothing is built per skeleton, so that the kernels can be compiled once per robot.

Poses of boxes are level, ``(x, y, yaw, z)`` in the robot's frame (m, rad), ``z`` the height of the
centre before an offset. All residuals are multiplied by ``SCALE`` where they are lengths, so that
one tolerance serves all. Equalities are ``c = 0``, inequalities ``c >= 0``.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import casadi as ca
import numpy as np

SCALE = 5.0
"""Weight of a residual in m against one in rad."""


@dataclass(frozen=True)
class KernelShape:
    """What programs have to know of one kind of constraint."""

    name: str
    equality: bool
    inputs: int
    parameters: int
    rows: int
    lengths: int
    """How many rows, the first ones, are lengths; the others are in rad."""


@dataclass(frozen=True)
class Shared:
    """What of a residual depends on its first arguments and parameters alone.

    Instances that have those in common share it, as the obstacles of one configuration of an arm
    share where the arm is. Evaluated apart, it gives the same numbers as within the residual.
    """

    inputs: int
    """How many arguments, the first ones."""
    parameters: int
    values: Any
    """CasADi function of (x, p) to the values."""
    rows: Any
    """CasADi function of (x, p, values) to c (rows,)."""


@dataclass(frozen=True)
class Kernel(KernelShape):
    """One kind of constraint.

    ``residual`` and ``jacobian`` are CasADi functions of (x, p): arguments (inputs,) and
    parameters (parameters,) to c (rows,) and to c and its dense Jacobian (rows, inputs).
    """

    residual: Any
    jacobian: Any
    independent: Any
    """Like ``residual``, with no more rows than independent constraints, for other solvers."""
    shared: Shared | None = None

    @property
    def compiled(self) -> tuple[Any, ...]:
        """What the solver in C calls: for the rows, their Jacobian, and what they share."""
        if self.shared is None:
            return self.residual, self.jacobian
        return self.shared.rows, self.jacobian, self.shared.values


def kernel(
    name: str,
    x: Any,
    p: Any,
    c: Any,
    equality: bool = False,
    lengths: int | None = None,
    independent: Any = None,
    shared: Shared | None = None,
) -> Kernel:
    """The kernel of a symbolic residual.

    Args:
        name: of the constraint, and of the kinematics that it is about.
        x: symbols of the arguments.
        p: symbols of the parameters.
        c: expression of the rows, scaled.
        equality: whether the rows vanish; otherwise none is negative.
        lengths: how many rows, the first ones, are lengths; all by default.
        independent: of the rows, an equivalent without dependent ones.
        shared: by instances with the same first arguments and parameters.
    """
    jacobian = ca.densify(ca.jacobian(c, x))
    return Kernel(
        name=name,
        equality=equality,
        inputs=x.numel(),
        parameters=p.numel(),
        rows=c.numel(),
        lengths=c.numel() if lengths is None else lengths,
        residual=ca.Function(f"{name}_residual", [x, p], [ca.densify(c)]),
        # transposed: CasADi stores columns, the solver reads rows
        jacobian=ca.Function(f"{name}_jacobian", [x, p], [ca.densify(c), jacobian.T]),
        independent=ca.Function(
            f"{name}_independent", [x, p], [c if independent is None else independent]
        ),
        shared=shared,
    )


def absolute(value: Any) -> Any:
    """Absolute value, smooth at zero."""
    return ca.sqrt(value**2 + 1e-8)


def distance(vector: Any) -> Any:
    """Length of a vector, with a derivative at zero."""
    return ca.sqrt(ca.sumsqr(vector) + 1e-12)


def in_frame(yaw: Any, vector: Any) -> tuple[Any, Any]:
    """The horizontal part of a vector in a frame turned by ``yaw``."""
    cosine, sine = ca.cos(yaw), ca.sin(yaw)
    return cosine * vector[0] + sine * vector[1], -sine * vector[0] + cosine * vector[1]


AnyKernel = TypeVar("AnyKernel", bound=KernelShape)


class KernelTable(Generic[AnyKernel]):
    """The kernels of one robot, or their shapes; their numbers are those in the solver."""

    def __init__(self, kernels: Iterable[AnyKernel]) -> None:
        self.kernels = tuple(kernels)
        self.number = {kernel.name: index for index, kernel in enumerate(self.kernels)}
        """By the kernel's name."""
        self.sizes = np.array([[k.inputs, k.parameters, k.rows] for k in self.kernels]).T.copy()
        """(3, kernels) numbers of inputs, parameters and rows."""

    def __getitem__(self, number: int) -> AnyKernel:
        return self.kernels[number]

    def __iter__(self) -> Iterator[AnyKernel]:
        return iter(self.kernels)
