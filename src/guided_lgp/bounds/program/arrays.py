"""The nonlinear program in arrays, and what builds it."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.program.kernels import KernelShape, KernelTable
from guided_lgp.bounds.results import Array

Integers = NDArray[np.intc]


@dataclass(frozen=True)
class Program:
    """min 1/2 sum w (x - t)^2 over lower <= x <= upper, subject to the rows of kernel instances.

    Instance i is kernel ``kernel[i]`` of the values in its slots, with its parameters: both come
    after those of the instances before it, and so do its rows. A slot that is not negative is that
    of a variable, -1 that of the first constant. The first fields are those of the structure in C,
    in its order.
    """

    kernel: Integers
    slots: Integers
    levers: Array
    """How much a row changes at most per unit of each input; infinite where that is not known."""
    parameters: Array
    weight: Array
    target: Array
    lower: Array
    upper: Array
    order: Integers
    """Place of each variable in the factorisation; negative: of those after all others, from -1."""
    sizes: Integers
    """(3, kernels) numbers of inputs, parameters and rows."""

    def holding(self, values: Array) -> "Program":
        """With the first variables at values where they stay."""
        count = len(values)
        lower = np.concatenate([values, self.lower[count:]])
        upper = np.concatenate([values, self.upper[count:]])
        return replace(self, lower=lower, upper=upper)

    @property
    def variables(self) -> int:
        """Number of variables."""
        return len(self.weight)

    @property
    def instances(self) -> int:
        """Number of kernel instances."""
        return len(self.kernel)

    @cached_property
    def rows(self) -> int:
        """Number of constraints."""
        return int(self.sizes[2].take(self.kernel).sum())

    @cached_property
    def inputs(self) -> Integers:
        """The indices of all slots in the values, variables first, then constants."""
        return np.where(self.slots < 0, self.variables - 1 - self.slots, self.slots)

    @cached_property
    def starts(self) -> Integers:
        """(3, instances + 1) where the inputs, parameters and rows of each instance begin."""
        first = np.zeros((3, 1), dtype=np.intc)
        return np.hstack([first, np.cumsum(self.sizes[:, self.kernel], axis=1, dtype=np.intc)])


class Instance(NamedTuple):
    """What a kernel instance means: its constraint's name and symbols, and the action's index."""

    action: int
    kernel: int
    names: tuple[str, ...]
    links: tuple[str, ...] = ()
    """The link that each row is about, where rows are about links; it stands for the gripper."""

    def name(self, row: int) -> str:
        """Of the constraint in one of its rows."""
        if not self.links:
            return " ".join(self.names)
        return " ".join((self.names[0], self.links[row], *self.names[2:]))


@dataclass(frozen=True)
class Instances:
    """Kernel instances that several configurations of an arm add alike, but for its joints."""

    meanings: list[Instance]
    kernel: "array[int]"
    inputs: list[tuple[int, ...]]
    """The slots of each, after those of the joints."""
    parameters: "array[float]"
    levers: "array[float]"
    """Of all inputs."""


@dataclass(frozen=True)
class Variables:
    """Variables in which rows of one configuration alone meet; see ``ProgramBuilder.variable``."""

    lower: "array[float]"
    upper: "array[float]"
    weight: "array[float]"
    target: "array[float]"


_UNKNOWN = array("d", [np.inf])
"""Lever of an input."""


class ProgramBuilder:
    """Collects variables, constants and kernel instances."""

    def __init__(self, table: KernelTable[KernelShape]) -> None:
        self._table = table
        self.constants = array("d", [0.0])
        self.instances: list[Instance] = []
        self._lower = array("d")
        self._upper = array("d")
        self._weight = array("d")
        self._target = array("d")
        self._order = array("i")
        """Among the variables of one configuration alone, or (negative) after all these."""
        self._alone = self._shared = 0
        self._kernel = array("i")
        self._slots = array("i")
        self._levers = array("d")
        self._parameters = array("d")

    def copy(self) -> "ProgramBuilder":
        """Another that goes on from here."""
        other = ProgramBuilder.__new__(ProgramBuilder)
        for name, value in vars(self).items():
            setattr(other, name, value[:] if isinstance(value, array | list) else value)
        return other

    def constant(self, value: float) -> int:
        """The slot of a new constant."""
        self.constants.append(value)
        return -len(self.constants)

    def variable(self, lower: float, upper: float, weight: float, target: float) -> int:
        """The slot of a new variable in which rows of several configurations meet.

        All others are eliminated before it, which keeps the factorisation sparse.

        Args:
            lower: bound.
            upper: bound.
            weight: of the squared distance from the target.
            target: where the variable is drawn to.
        """
        self._lower.append(lower)
        self._upper.append(upper)
        self._weight.append(weight)
        self._target.append(target)
        self._shared += 1
        self._order.append(-self._shared)
        return len(self._lower) - 1

    def variables(self, added: Variables) -> range:
        """The slots of new variables."""
        first = len(self._lower)
        self._lower.extend(added.lower)
        self._upper.extend(added.upper)
        self._weight.extend(added.weight)
        self._target.extend(added.target)
        count, self._alone = self._alone, self._alone + len(added.lower)
        self._order.extend(range(count, self._alone))
        return range(first, len(self._lower))

    def rows(
        self,
        kernel: str,
        inputs: Sequence[int],
        parameters: Sequence[float],
        action: int,
        names: tuple[str, ...],
        links: tuple[str, ...] = (),
        levers: Sequence[float] | None = None,
    ) -> None:
        """Add an instance of a kernel; see :class:`Instance` and :class:`Program`."""
        number = self.number(kernel)
        self._kernel.append(number)
        self._slots.extend(inputs)
        self._parameters.extend(parameters)
        self._levers.extend(_UNKNOWN * len(inputs) if levers is None else levers)
        self.instances.append(Instance(action, number, names, links))

    def number(self, kernel: str) -> int:
        """Of a kernel in the table."""
        return self._table.number[kernel]

    def repeat(self, instances: Instances, joints: tuple[int, ...]) -> None:
        """Add instances for one configuration of the arm, the slots of its joints."""
        self._kernel.extend(instances.kernel)
        for others in instances.inputs:
            self._slots.extend(joints + others)
        self._parameters.extend(instances.parameters)
        self._levers.extend(instances.levers)
        self.instances.extend(instances.meanings)

    def build(self) -> Program:
        """The program, in the memory of this builder: nothing is added to it any more."""
        return Program(
            kernel=np.frombuffer(self._kernel, np.intc),
            slots=np.frombuffer(self._slots, np.intc),
            levers=np.frombuffer(self._levers),
            parameters=np.frombuffer(self._parameters),
            weight=np.frombuffer(self._weight),
            target=np.frombuffer(self._target),
            lower=np.frombuffer(self._lower),
            upper=np.frombuffer(self._upper),
            order=np.frombuffer(self._order, np.intc),
            sizes=self._table.sizes,
        )
