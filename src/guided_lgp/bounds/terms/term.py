"""What every term has."""

from collections.abc import Callable
from dataclasses import dataclass

from guided_lgp.bounds.program.kernels import Kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.results import Array


def _none(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return ()


@dataclass(frozen=True)
class Term:
    """A constraint that declarations name.

    ``add(context, *symbols)`` adds its variables and rows to the program of a context; ``kernels``
    gives the kernels of these rows for a robot.
    """

    add: Callable[..., None]
    kernels: Callable[[RobotKinematics], tuple[Kernel, ...]] = _none


@dataclass(frozen=True, kw_only=True)
class GoalTerm(Term):
    """A constraint on where a box is at the end, which goal types name.

    ``draw(context, generator, count, box, support, below, **numbers)`` gives places (count, 3) for
    starts: x, y (m) and yaw (rad) in the robot's frame, on a support at ``below`` (4,).
    ``check(size, placement, top, **numbers)`` is by how much (m or rad) the term does not hold.
    """

    draw: Callable[..., Array]
    check: Callable[..., float]


class UngraspableError(Exception):
    """No side of a box is narrow enough for the fingers."""

    def __init__(self, action: int, box: str, excess: float) -> None:
        super().__init__(f"box {box!r} is {excess:.3f} m too wide")
        self.action, self.box, self.excess = action, box, excess
