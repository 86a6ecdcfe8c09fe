"""What every term has."""

from collections.abc import Callable
from dataclasses import dataclass

from guided_lgp.bounds.program.kernels import Kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics


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


class UngraspableError(Exception):
    """No side of a box is narrow enough for the fingers."""

    def __init__(self, action: int, box: str, excess: float) -> None:
        super().__init__(f"box {box!r} is {excess:.3f} m too wide")
        self.action, self.box, self.excess = action, box, excess
