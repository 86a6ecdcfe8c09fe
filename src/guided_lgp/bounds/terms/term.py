"""What every term has."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from guided_lgp.bounds.program.kernels import Kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.results import Array
from guided_lgp.logic.declarations import Instruction, Variable


def _none(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return ()


def _never(instruction: Instruction) -> tuple[tuple[Variable, ...], ...]:
    return ()


@dataclass(frozen=True)
class Term:
    """A constraint that declarations name.

    ``add(context, *symbols)`` adds its variables and rows to the program of a context; ``kernels``
    gives the kernels of these rows for a robot.
    """

    add: Callable[..., None]
    kernels: Callable[[RobotKinematics], tuple[Kernel, ...]] = _none
    part: Literal["contact", "final", "postures", "lasting"] = "contact"
    """Where declarations name it: of an instruction, or of a goal type."""
    levels: bool = False
    """Whether a hand that holds what it names keeps that level, all the time."""
    attaches: str = ""
    """The type of parent on which a body hangs by it, if one does."""
    needed: Callable[[Instruction], Iterable[tuple[Variable, ...]]] = _never
    """With which arguments an instruction has to name it, by what it attaches to what."""


def put_down(instruction: Instruction) -> Iterator[tuple[Variable, ...]]:
    """Of what is put down: the body and its support."""
    if not instruction.into_hand:
        yield instruction.attached.body, instruction.attached.parent


@dataclass(frozen=True, kw_only=True)
class GoalTerm(Term):
    """A constraint on where a box is at the end, which goal types name.

    ``draw(context, generator, count, box, support, below, **numbers)`` gives places (count, 3) for
    starts: x, y (m) and yaw (rad) in the robot's frame, on a support at ``below`` (4,).
    ``check(size, placement, top, **numbers)`` is by how much (m or rad) the term does not hold.
    """

    part: Literal["contact", "final", "postures", "lasting"] = "final"
    draw: Callable[..., Array]
    check: Callable[..., float]


class UngraspableError(Exception):
    """No side of a box is narrow enough for the fingers."""

    def __init__(self, action: int, box: str, excess: float) -> None:
        super().__init__(f"box {box!r} is {excess:.3f} m too wide")
        self.action, self.box, self.excess = action, box, excess
