"""The nonlinear program in arrays, and what builds it."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.program.kernels import KernelShape, KernelTable
from guided_lgp.bounds.results import Array

Integers = NDArray[np.intc]


@dataclass(frozen=True)
class Program:
    """min 1/2 sum w (x - t)^2 over lower <= x <= upper, subject to the rows of kernel instances.

    Instance i is kernel ``kernel[i]`` of the values at ``inputs[input_start[i]:...]`` (indices
    below the number of variables are variables, the others constants) with the parameters that
    start at ``parameters[parameter_start[i]]``; its rows start at ``row_start[i]``, and
    ``row_start`` has one entry more, the number of rows. ``order[v]`` is the place of a variable
    in the factorisation. The fields are those of the structure in C, in its order.
    """

    kernel: Integers
    input_start: Integers
    inputs: Integers
    levers: Array
    """How much a row changes at most per unit of each input; infinite where that is not known."""
    parameter_start: Integers
    row_start: Integers
    parameters: Array
    weight: Array
    target: Array
    lower: Array
    upper: Array
    order: Integers

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

    @property
    def rows(self) -> int:
        """Number of constraints."""
        return int(self.row_start[-1])


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
        """Places among the variables of one configuration alone, or (negative) after all these."""
        self._alone = self._shared = 0
        self._kernel = array("i")
        self._inputs = array("i")
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
        self._inputs.extend(inputs)
        self._parameters.extend(parameters)
        self._levers.extend([np.inf] * len(inputs) if levers is None else levers)
        self.instances.append(Instance(action, number, names, links))

    def number(self, kernel: str) -> int:
        """Of a kernel in the table."""
        return self._table.number[kernel]

    def repeat(self, instances: Instances, joints: tuple[int, ...]) -> None:
        """Add instances for one configuration of the arm, the slots of its joints."""
        self._kernel.extend(instances.kernel)
        for others in instances.inputs:
            self._inputs.extend(joints + others)
        self._parameters.extend(instances.parameters)
        self._levers.extend(instances.levers)
        self.instances.extend(instances.meanings)

    def build(self) -> Program:
        """The program."""
        kernel = np.array(self._kernel)
        starts = np.zeros((3, len(kernel) + 1), dtype=np.intc)
        np.cumsum(self._table.sizes[:, kernel], axis=1, out=starts[:, 1:])
        return Program(
            kernel=kernel,
            input_start=starts[0],
            inputs=_after(self._inputs, len(self._lower)),
            levers=np.array(self._levers),
            parameter_start=starts[1],
            row_start=starts[2],
            parameters=np.array(self._parameters),
            weight=np.array(self._weight),
            target=np.array(self._target),
            lower=np.array(self._lower),
            upper=np.array(self._upper),
            order=_after(self._order, self._alone),
        )


def _after(places: "array[int]", count: int) -> Integers:
    """Places of which negative ones, from -1 on, come after a number of others."""
    found = np.array(places)
    return np.where(found < 0, count - 1 - found, found)
