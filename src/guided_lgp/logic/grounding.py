"""All actions and goals over some symbols, in the order of their declarations."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import product

from guided_lgp.logic.actions import Action, Goal
from guided_lgp.logic.declarations import Variable
from guided_lgp.logic.domain import GroundInstruction
from guided_lgp.logic.state import GroundAtom
from guided_lgp.logic.symbols import Symbols


@lru_cache(maxsize=64)
def ground_instructions(symbols: Symbols) -> tuple[GroundInstruction, ...]:
    """Every action that some state may allow.

    They come by acting gripper, then by the body that they move, then by instruction, then by
    their other symbols, each as declared. This is the order of children in the logic tree.
    """
    domain = symbols.domain
    ground = [
        domain.bind(Action(instruction.name, names))
        for instruction in domain.instructions
        for names in _assignments(instruction.parameters, symbols)
    ]
    rank = {name: number for number, name in enumerate((*symbols.grippers, *symbols.movable))}
    ground.sort(key=lambda one: (rank[one.actor], rank[one.body]))
    return tuple(one for one in ground if one.body != one.parent and is_possible(one.precondition))


def all_goals(symbols: Symbols) -> list[Goal]:
    """Every goal that some state may fulfil, by goal type, then by its symbols, as declared."""
    goals = [
        Goal(goal_type.name, names)
        for goal_type in symbols.domain.goal_types
        for names in _assignments(goal_type.parameters, symbols)
    ]
    return [goal for goal in goals if is_possible(symbols.domain.conditions(goal))]


def is_possible(atoms: Sequence[GroundAtom]) -> bool:
    """Whether no atom is false in every state: nothing hangs on itself, all is what it is."""
    return not any(_is_false(atom) for atom in atoms)


def _is_false(atom: GroundAtom) -> bool:
    equal = len(set(atom.symbols)) < len(atom.symbols)
    match atom.predicate:
        case "same":
            return equal == atom.negated
        case "carries":
            return equal and atom.negated
        case "on" | "holds":
            return equal and not atom.negated
    return False


def _assignments(parameters: Sequence[Variable], symbols: Symbols) -> Iterator[tuple[str, ...]]:
    return product(*(symbols.of(variable.type.name) for variable in parameters))
