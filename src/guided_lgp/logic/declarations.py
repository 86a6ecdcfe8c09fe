"""What a domain is declared with: types, atoms, terms, instructions and goal types.

Declarations are data. Terms and steps are names with arguments; the layers above find their parts
by these names.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from guided_lgp.logic.symbols import GRIPPER


@dataclass(frozen=True)
class Type:
    """A logic type: of symbols that are ``also`` of other types, and that may hang on ``parents``.

    What has parents is movable: at any time it has exactly one, a symbol of one of these types.
    Calling a type makes a variable of it.
    """

    name: str
    also: tuple["Type", ...] = ()
    parents: tuple["Type", ...] = ()

    def __call__(self, name: str) -> "Variable":
        """A variable of this type."""
        return Variable(name, self)

    def is_a(self, other: "Type") -> bool:
        """Whether every symbol of this type is one of the other."""
        return other.name in self.kinds

    @property
    def kinds(self) -> tuple[str, ...]:
        """The names of all types that a symbol of this one is of, its own first."""
        return (self.name, *(name for further in self.also for name in further.kinds))


@dataclass(frozen=True)
class Variable:
    """A parameter of an instruction or goal type."""

    name: str
    type: Type


@dataclass(frozen=True)
class Atom:
    """A statement about a state, or its negation: ``~held(b)``."""

    predicate: str
    arguments: tuple[Variable, ...]
    negated: bool = False

    def __invert__(self) -> "Atom":
        return Atom(self.predicate, self.arguments, not self.negated)


def holds(gripper: Variable, body: Variable) -> Atom:
    """The gripper holds the body."""
    return Atom("holds", (gripper, body))


def held(body: Variable) -> Atom:
    """Some gripper holds the body."""
    return Atom("held", (body,))


def free(gripper: Variable) -> Atom:
    """The gripper holds nothing."""
    return Atom("free", (gripper,))


def on(body: Variable, support: Variable) -> Atom:
    """The body stands directly on the support."""
    return Atom("on", (body, support))


def clear(support: Variable) -> Atom:
    """Nothing stands on the support."""
    return Atom("clear", (support,))


def carries(body: Variable, other: Variable) -> Atom:
    """The other is the body itself or stands on it, directly or through others."""
    return Atom("carries", (body, other))


def same(one: Variable, other: Variable) -> Atom:
    """Both are one symbol."""
    return Atom("same", (one, other))


def idle() -> Atom:
    """No gripper holds anything."""
    return Atom("idle", ())


@dataclass(frozen=True)
class FactType:
    """A predicate that the mode tree does not tell: ``opened = FactType("open", (d,))``.

    Calling it makes an atom of it, for conditions and, what holds from then on, for effects.
    """

    name: str
    parameters: tuple[Variable, ...]

    def __call__(self, *arguments: Variable) -> Atom:
        """The statement about these parameters."""
        return Atom(self.name, arguments)


@dataclass(frozen=True)
class Attach:
    """The effect that the body hangs on another parent from now on; see :func:`attach`."""

    body: Variable
    parent: Variable


def attach(body: Variable, parent: Variable) -> Attach:
    """The body hangs on the parent from now on; what stands on the body moves with it."""
    return Attach(body, parent)


@dataclass(frozen=True)
class Term:
    """A constraint or a step of a motion, by name: ``line_in(g, back=0.09)``."""

    name: str
    arguments: tuple[Variable, ...]
    options: Mapping[str, Variable | float | str] = field(default_factory=dict, hash=False)


def terms(names: str) -> tuple[Callable[..., Term], ...]:
    """Functions that make terms or steps of these names: ``hold, pads = terms("hold pads")``."""

    def maker(name: str) -> Callable[..., Term]:
        return lambda *arguments, **options: Term(name, arguments, options)

    return tuple(map(maker, names.split()))


_HOLDS = ("holds", False)


@dataclass(frozen=True)
class Instruction:
    """A kind of action: what it needs, what it changes, and its geometry.

    The first parameter is the acting gripper. One effect attaches a body; others are facts.
    ``contact`` are the terms that it adds at its contact keyframe, ``motion`` the steps of its
    motion, both in order.
    """

    name: str
    parameters: tuple[Variable, ...]
    precondition: tuple[Atom, ...]
    effect: tuple[Attach | Atom, ...]
    contact: tuple[Term, ...] = ()
    motion: tuple[Term, ...] = ()

    @property
    def attached(self) -> Attach:
        """The effect on the mode tree."""
        return next(effect for effect in self.effect if isinstance(effect, Attach))

    @property
    def into_hand(self) -> bool:
        """Whether a gripper holds the body afterwards."""
        return GRIPPER in self.attached.parent.type.kinds

    @property
    def holder(self) -> Variable | None:
        """The gripper that holds the body before, by the precondition; None if it stands."""
        body = self.attached.body
        held = (atom for atom in self.precondition if (atom.predicate, atom.negated) == _HOLDS)
        return next((atom.arguments[0] for atom in held if atom.arguments[1] == body), None)


@dataclass(frozen=True)
class Number:
    """A number that a goal gives; one with a default may be left out, after all others."""

    name: str
    default: float | None = None


def numbers(names: str, **defaults: float) -> tuple[Number, ...]:
    """Numbers of a goal: ``numbers("x y", tolerance=0.01)``."""
    optional = (Number(name, default) for name, default in defaults.items())
    return (*map(Number, names.split()), *optional)


@dataclass(frozen=True)
class GoalType:
    """A kind of goal: what must be true of its parameters, and where it leaves a body.

    Numbers follow the parameters in a goal's text. ``final`` are the terms that hold at the end of
    a plan for bodies, ``postures`` those for arms, ``lasting`` those that hold all the time; a term
    has the numbers as options, those of a series called ``joint`` as ``joint1``, ``joint2``, ...
    """

    name: str
    parameters: tuple[Variable, ...]
    condition: tuple[Atom, ...] = ()
    numbers: tuple[Number, ...] = ()
    series: str = ""
    """The name of further numbers, one or more: their count depends on a symbol."""
    final: tuple[Term, ...] = ()
    postures: tuple[Term, ...] = ()
    lasting: tuple[Term, ...] = ()
    derived: Variable | None = None
    """The parameter that a text may leave out: what is below the pose that the numbers give."""
