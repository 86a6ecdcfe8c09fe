"""The declared motion of an instruction as geometry: which arm goes where along which lines.

A motion is a list of steps, in this order:

- ``present(x)``: the arm that holds x, or what x stands on, brings it where it is needed;
- ``transit(g)``: the acting arm comes to the beginning of its way in;
- ``line_in(g, ...)``: its tool goes straight to the contact;
- ``switch(close=g, open=g)``: fingers close and open, and the body changes its parent;
- ``line_out(g, ...)``: an arm leaves straight;
- ``home(g)``: an arm goes to its side, unless it carries a stack, which stays where it is.

There may be any number of ``present`` and ``home``, and one of each other. Lines name their
direction and length (m): ``back`` against the approach of the hand, ``up`` or ``down`` along the
vertical; ``otherwise`` names a direction for further ways.
"""

import math
from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.program import context
from guided_lgp.bounds.results import Array
from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Domain, GroundInstruction, GroundTerm
from guided_lgp.logic.declarations import Instruction, Term

_ONCE = ("transit", "line_in", "switch", "line_out")
STEPS = ("present", *_ONCE, "home")
"""Every step, in the order in which a motion may have them."""
_OF_ARMS = ("transit", "line_in", "line_out", "home")
_DIRECTIONS = ("back", "down", "up")
_LINE = (*_DIRECTIONS, "otherwise")
_OPTIONS = {"present": ("by",), "line_in": _LINE, "switch": ("close", "open"), "line_out": _LINE}
"""Which options steps have."""
_PAST = 0.11
"""Length (m) of the way up on which an open hand leaves what it held, however deep."""
_FLAT = math.cos(math.pi / 4)
"""Of the angle between the fingers' closing direction and the vertical."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Way:
    """A displacement of the tool: length x (up x vertical - back x approach + aside)."""

    length: float
    up: float = 0.0
    back: float = 0.0
    aside: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def of(self, rotation: Array) -> Array:
        """The displacement (..., 3) in m for rotations (..., 3, 3) of the tool frame."""
        bearing = self.up * UP - self.back * rotation[..., :, 0] + self.aside
        return np.asarray(self.length * bearing)


_ASIDE = tuple(
    Way(1.0, up=0.05, aside=(x, y, 0.0))
    for x, y in ((0.07, 0.0), (0.0, 0.07), (-0.07, 0.0), (0.0, -0.07))
)
"""Ways (m) up from a place past an arm that leans over it."""


LOW = Way(1.0, back=context.LOW[0], up=context.LOW[1])
"""The way of a box out of and into where something is above it."""


@dataclass(frozen=True)
class Line:
    """A straight line of a tool, which does not turn. Its ways lead away from the contact."""

    gripper: str
    ways: tuple[Way, ...]
    aside: tuple[Way, ...] = ()
    """Further ways, for where none of the first is free."""


@dataclass(frozen=True)
class Manoeuvre:
    """The motion of an action."""

    name: str
    """Of the instruction."""
    body: str
    """What is moved ..."""
    parent: str
    """... and what holds or supports it afterwards."""
    presented: tuple[str, ...]
    way_in: Line
    way_out: Line
    closing: str | None
    opening: str | None
    homes: tuple[str, ...]

    @property
    def gripper(self) -> str:
        """Whose arm makes the contact."""
        return self.way_in.gripper

    def ways_out(self, rotation: Array) -> tuple[Way, ...]:
        """The ways out for a rotation (3, 3) of the tool frame.

        A hand that lets go at top and bottom has a finger below the body: it leaves backwards.
        """
        ways = self.way_out.ways
        if self.opening == self.way_out.gripper and abs(rotation[2, 1]) > _FLAT:
            return tuple(way for way in ways if way.up == 0.0)
        return ways


def manoeuvre(declared: GroundInstruction, file: str = "") -> Manoeuvre:
    """Read the declared motion of an action.

    Args:
        declared: the action by its declaration.
        file: where that is, for messages: ``"handover.py: "``.

    Raises:
        InputError: a straight line has no direction.
    """
    name, motion = declared.action.instruction, declared.motion
    where = f"{file}instruction {name}, motion"
    once = {step.name: step for step in motion}
    fingers = {hand: str(gripper) for hand, gripper in once["switch"].options.items()}
    return Manoeuvre(
        name,
        declared.body,
        declared.parent,
        presented=tuple(step.symbols[0] for step in motion if step.name == "present"),
        way_in=_way_in(where, once["line_in"]),
        way_out=_way_out(where, once["line_out"]),
        closing=fingers.get("close"),
        opening=fingers.get("open"),
        homes=tuple(step.symbols[0] for step in motion if step.name == "home"),
    )


def check_motions(domain: Domain) -> None:
    """Read the motion of every instruction of a domain.

    Raises:
        InputError: one of them cannot be carried out: a step is unknown, missing or out of its
            order, or lacks what the instruction's effect needs.
    """
    for instruction in domain.instructions:
        where = f"{domain.name}.py: instruction {instruction.name}, motion"
        _check_order(where, [step.name for step in instruction.motion])
        for step in instruction.motion:
            _check_step(f"{where}: {step.name}", step, instruction)
        _check_presented(where, instruction)
        names = tuple(parameter.name for parameter in instruction.parameters)
        manoeuvre(domain.bind(Action(instruction.name, names)), f"{domain.name}.py: ")


def _check_order(where: str, names: list[str]) -> None:
    for step in names:
        if step not in STEPS:
            raise InputError(f"{where}: {step}", "is an unknown step", ", ".join(STEPS))
    if names != sorted(names, key=STEPS.index) or any(names.count(name) != 1 for name in _ONCE):
        accepted = f"present ..., {', '.join(_ONCE)}, home ..."
        raise InputError(f"{where}: {', '.join(names)}", "are not the steps of a motion", accepted)


def _check_step(where: str, step: Term, one: Instruction) -> None:
    """That a step has the arguments and options that it takes, and moves an arm that has a part."""
    count, accepted = int(step.name != "switch"), _OPTIONS.get(step.name, ())
    if len(step.arguments) != count:
        raise InputError(where, f"has {len(step.arguments)} arguments", str(count))
    for option in step.options:
        if option not in accepted:
            raise InputError(where, f"unknown option {option!r}", ", ".join(accepted) or "none")
    taker = one.attached.parent if one.into_hand else None
    hands = {"close": taker, "open": one.holder}
    arms = one.parameters[:1] if step.name in ("transit", "line_in") else hands.values()
    if step.name in _OF_ARMS and not set(step.arguments) <= {*arms} & {*hands.values()}:
        names = ", ".join(arm.name for arm in arms if arm is not None)
        raise InputError(where, f"{step.arguments[0].name} has no part in it", names)
    if step.name == "switch" and step.options != {k: v for k, v in hands.items() if v is not None}:
        wanted = ", ".join(f"{hand}={arm.name}" for hand, arm in hands.items() if arm is not None)
        raise InputError(where, "is not what the effect makes of the hands", wanted)


def _check_presented(where: str, one: Instruction) -> None:
    """That what may be in another hand, or on something in it, is brought."""
    needed = [] if one.holder == one.parameters[0] else [one.attached.body]
    needed += [] if one.into_hand else [one.attached.parent]
    presented = [step.arguments[0] for step in one.motion if step.name == "present"]
    for body in needed:
        if body not in presented:
            accepted = ", ".join(f"present({body.name})" for body in needed)
            raise InputError(where, f"lacks present({body.name})", accepted)


def _way_in(where: str, step: GroundTerm) -> Line:
    direction, length, otherwise = _direction(where, step)
    ways = [_straight(name, length) for name in (direction, otherwise) if name]
    return Line(step.symbols[0], tuple(ways), (*_ASIDE, LOW) if direction == "down" else ())


def _way_out(where: str, step: GroundTerm) -> Line:
    """What is lifted may also leave its support backwards, half as far, or low; a hand that cannot
    leave backwards rises at the same time, or rises past the body.
    """
    direction, length, otherwise = _direction(where, step)
    ways = [_straight(direction, length)]
    if direction == "up":
        ways += [Way(length, up=0.8, back=0.6), Way(0.5 * length, up=1.0), LOW]
    if otherwise:
        ways += [Way(length, up=0.5, back=1.0), Way(_PAST, up=1.0)]
    return Line(step.symbols[0], tuple(ways))


def _direction(where: str, step: GroundTerm) -> tuple[str, float, str]:
    """Direction and length (m) of a straight line, and the direction of another way, if any."""
    given = {name: length for name, length in step.options.items() if name != "otherwise"}
    otherwise = str(step.options.get("otherwise", ""))
    known = set(given) <= set(_DIRECTIONS) and (not otherwise or otherwise in _DIRECTIONS)
    if len(given) != 1 or not known or not all(isinstance(v, int | float) for v in given.values()):
        accepted = f"one of {', '.join(_DIRECTIONS)} with a length in m, otherwise=one of them"
        raise InputError(f"{where}: {step.name}", "has no direction", accepted)
    ((direction, length),) = given.items()
    return direction, float(length), otherwise


def _straight(direction: str, length: float) -> Way:
    return Way(length, back=1.0) if direction == "back" else Way(length, up=1.0)
