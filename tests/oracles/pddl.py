"""The paper's domain in PDDL, written independently of the planners under test.

Plain typed STRIPS. "The table does not stand, directly or through others, on the box" becomes one
schema per way down from the table: the chain of boxes below it must end on a surface or in the
other gripper, which it cannot do if the held box is part of it.
"""

import itertools

from guided_lgp.logic import Action, Objective, State, Symbols

HEAD = """(define (domain pick-and-place)
 (:requirements :strips :typing)
 (:types box surface - support gripper support)
 (:predicates (free ?g - gripper) (holding ?g - gripper ?b - box) (carried ?b - box)
  (on ?b - box ?s - support) (other ?g ?h - gripper))
 (:action take :parameters (?g - gripper ?b - box ?s - support)
  :precondition (and (free ?g) (on ?b ?s))
  :effect (and (holding ?g ?b) (carried ?b) (not (free ?g)) (not (on ?b ?s))))
"""
RELEASE = "(free ?g) (not (holding ?g ?b)) (not (carried ?b))"


def domain(symbols: Symbols) -> str:
    """The domain with chains as long as the number of boxes allows."""
    text = HEAD
    text += f""" (:action put-surface :parameters (?g - gripper ?b - box ?s - surface)
  :precondition (holding ?g ?b) :effect (and (on ?b ?s) {RELEASE}))
"""
    for length in range(1, len(symbols.boxes)):
        chain = [f"?c{i}" for i in range(length)]
        links = " ".join(f"(on {a} {b})" for a, b in itertools.pairwise(chain))
        boxes = " ".join(f"{box} - box" for box in chain)
        for end, parameter, condition in (
            ("surface", "?s - surface", f"(on {chain[-1]} ?s)"),
            ("hand", "?h - gripper", f"(holding ?h {chain[-1]}) (other ?g ?h)"),
        ):
            text += f""" (:action put-{length}-{end} :parameters (?g - gripper ?b - box {boxes}
   {parameter}) :precondition (and (holding ?g ?b) {links} {condition})
  :effect (and (on ?b ?c0) {RELEASE}))
"""
    return text + ")\n"


def initial_facts(state: State, symbols: Symbols) -> list[list[str]]:
    """What holds in a state; names in lower case, as PDDL ignores case."""
    busy = {gripper for _, gripper in state.held}
    facts = [f"on {box} {table}" for box, table in state.support]
    facts += [f"holding {gripper} {box}" for box, gripper in state.held]
    facts += [f"carried {box}" for box, _ in state.held]
    facts += [f"free {gripper}" for gripper in symbols.grippers if gripper not in busy]
    facts += [f"other {g} {h}" for g in symbols.grippers for h in symbols.grippers if g != h]
    return [fact.lower().split() for fact in facts]


def goal_facts(objective: Objective) -> list[list[str]]:
    """What an objective asks for."""
    return [["carried" if goal.kind == "held" else "on", *goal.symbols] for goal in objective]


def problem(state: State, objective: Objective, symbols: Symbols) -> str:
    """One planning problem."""
    facts = " ".join(f"({' '.join(fact)})" for fact in initial_facts(state, symbols))
    goals = " ".join(f"({' '.join(fact)})" for fact in goal_facts(objective))
    return f"""(define (problem p) (:domain pick-and-place)
 (:objects {" ".join(symbols.grippers).lower()} - gripper {" ".join(symbols.boxes)} - box
  {" ".join(symbols.surfaces)} - surface)
 (:init {facts})
 (:goal (and {goals})))
"""


def step(state: State, action: Action, symbols: Symbols) -> str:
    """The ground PDDL action of an action in a state."""
    gripper, box, *support = action.symbols
    if not support:
        words = ["take", gripper, box, str(state.support_of(box))]
    elif support[0] in symbols.surfaces:
        words = ["put-surface", gripper, box, support[0]]
    else:
        chain = support
        while (below := state.support_of(chain[-1])) in symbols.boxes:
            chain.append(str(below))
        end = "hand" if below is None else "surface"
        bottom = below or str(state.holder(chain[-1]))
        words = [f"put-{len(chain)}-{end}", gripper, box, *chain, bottom]
    return f"({' '.join(words)})".lower()


def action(text: str, symbols: Symbols) -> Action:
    """The action of a ground PDDL action."""
    names = {name.lower(): name for name in (*symbols.grippers, *symbols.tables)}
    schema, gripper, box, target, *_ = text.strip("()").split()
    if schema == "take":
        return Action("grasp", (names[gripper], names[box]))
    return Action("place", (names[gripper], names[box], names[target]))
