"""Under which conditions a plan is carried out."""

from dataclasses import dataclass
from typing import Literal, get_args

from guided_lgp.errors import InputError

Grip = Literal["fixed", "friction"]
FRICTION = (0.1, 2.0)
FORCE = (1.0, 1000.0)
NOISE = (0.0, 0.05)


@dataclass(frozen=True)
class Conditions:
    """How boxes are held, and what is not as planned.

    Raises:
        InputError: a value is out of range.
    """

    grip: Grip = "fixed"
    """Rigid in the hand, or by the friction of its fingertips."""
    friction: float = 0.64
    """Coefficient of friction between any two bodies."""
    force: float | None = None
    """N with which fingers press, in place of what each grasp wants."""
    noise: float = 0.0
    """Standard deviation (m) along x and y by which an arm misplaces a box."""
    seed: int = 0
    """Of that noise."""

    def __post_init__(self) -> None:
        if self.grip not in get_args(Grip):
            raise InputError("grip", f"unknown grip {self.grip!r}", ", ".join(get_args(Grip)))
        _check("friction", self.friction, FRICTION)
        _check("noise", self.noise, NOISE)
        if self.force is not None:
            _check("force", self.force, FORCE)


def _check(field: str, value: float, limits: tuple[float, float]) -> None:
    low, high = limits
    if not low <= value <= high:
        raise InputError(field, f"{value:g} is out of range", f"{low:g} to {high:g}")


AS_PLANNED = Conditions()
"""Nothing is amiss."""
