"""A domain with tools and facts, declared here, and declarations that cannot be served."""

from dataclasses import replace
from typing import Any

import pytest

from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    applicable_actions,
    least_actions,
    parse_objective,
    parse_skeleton,
    progress,
    satisfied,
    successor,
    validate_objective,
)
from guided_lgp.logic.declarations import (
    Atom,
    FactType,
    GoalType,
    Instruction,
    Type,
    attach,
    carries,
    clear,
    free,
    held,
    holds,
    numbers,
    on,
    same,
    terms,
)
from guided_lgp.logic.domain import Domain
from guided_lgp.logic.packed import packed_states
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.tree import StateSpace, distances

Gripper, Table = Type("gripper"), Type("table")
Tool = Type("tool", parents=(Gripper, Table))
Box = Type("box", also=(Table,), parents=(Gripper, Table, Tool))
g, h, k, b, t = Gripper("gripper"), Gripper("other"), Tool("tool"), Box("box"), Table("table")
near = FactType("near", (b,))
hold, drag = terms("hold drag")

PICK_TOOL = Instruction("take-tool", (g, k), (free(g), ~held(k)), (attach(k, g),))
LEAVE_TOOL = Instruction("leave-tool", (g, k, t), (holds(g, k), clear(k)), (attach(k, t),))
HOOK = Instruction("hook", (g, k, b), (holds(g, k), ~held(b), clear(b), clear(k)), (attach(b, k),))
PULL = Instruction(
    "pull",
    (g, k, b, t),
    (holds(g, k), on(b, k), ~near(b), ~carries(b, t)),
    (attach(b, t), near(b)),
    contact=(hold(g, k),),
    motion=(drag(b, by=k),),
)
PICK = Instruction("pick", (g, b), (free(g), ~held(b), near(b)), (attach(b, g),))
SWAP = Instruction("swap", (g, h, b), (free(g), holds(h, b), ~same(g, h)), (attach(b, g),))
HOOKS = Domain(
    "hooks",
    types=(Gripper, Table, Tool, Box),
    instructions=(PICK_TOOL, LEAVE_TOOL, HOOK, PULL, PICK, SWAP),
    goal_types=(
        GoalType("held", (b,), (held(b),)),
        GoalType("held-by", (b, g), (holds(g, b),)),
        GoalType("near", (b,), (near(b),)),
        GoalType("empty", (g,), (free(g),)),
    ),
    facts=(near,),
)
SYMBOLS = HOOKS.symbols(gripper=("left", "right"), table=("desk",), tool=("hook",), box=("a", "c"))
START = HOOKS.state({"a": "desk", "c": "desk", "hook": "desk"}, facts=[("near", "c")])


def test_a_box_hangs_on_a_tool_and_gets_near() -> None:
    assert SYMBOLS.movable == ("hook", "a", "c")
    assert SYMBOLS.surfaces == ("desk",)
    assert [str(action) for action in applicable_actions(START, SYMBOLS)] == [
        "(take-tool left hook)",
        "(pick left c)",
        "(take-tool right hook)",
        "(pick right c)",
    ]
    hooked = progress(START, parse_skeleton("(take-tool left hook) (hook left hook a)"))
    assert (hooked.parent_of("a"), hooked.children_of("hook")) == ("hook", ("a",))
    assert hooked.held == (("hook", "left"),)
    pulls = [str(action) for action in applicable_actions(hooked, SYMBOLS)]
    assert pulls[:2] == ["(pull left hook a desk)", "(pull left hook a c)"]
    pulled = successor(hooked, Action("pull", ("left", "hook", "a", "desk")))
    assert pulled.facts == (("near", "a"), ("near", "c"))
    assert Action("pick", ("right", "a")) in applicable_actions(pulled, SYMBOLS)


def test_a_ground_instruction() -> None:
    ground = HOOKS.bind(Action("pull", ("left", "hook", "a", "desk")))
    assert (ground.actor, ground.body, ground.parent, ground.into_hand) == (
        "left",
        "a",
        "desk",
        False,
    )
    assert [(term.name, term.symbols) for term in ground.contact] == [("hold", ("left", "hook"))]
    assert [(step.name, step.symbols, dict(step.options)) for step in ground.motion] == [
        ("drag", ("a",), {"by": "hook"})
    ]


def test_packed_states_are_the_states() -> None:
    """The packed successors and conditions against those of the states themselves."""
    packing = packed_states(SYMBOLS)
    space = StateSpace(SYMBOLS, START)
    space.explore()
    assert len(space) == 67
    for number in range(len(space)):
        state = space.state(number)
        assert packing.unpack(packing.pack(state)) == state
        for action, target in space.transitions(number):
            ground = HOOKS.bind(action)
            assert all(atom.holds_in(state) for atom in ground.precondition)
            assert successor(state, action) == space.state(target)
        assert len(set(space.actions(number))) == len(space.actions(number))


@pytest.mark.parametrize(
    ("goals", "length"),
    [
        (["(near a)"], 3),
        (["(held a)"], 4),
        (["(held c)"], 1),
        (["(held-by c right)", "(near a)"], 4),
        (["(held a)", "(held c)"], 6),
        (["(held a)", "(empty left)"], None),
    ],
)
def test_lower_bounds(goals: list[str], length: int | None) -> None:
    """Neither landmark-cut nor the bodies' own changes exceed the exact number of actions."""
    objective = parse_objective(goals)
    validate_objective(objective, SYMBOLS, START)
    space = StateSpace(SYMBOLS, START)
    space.explore()
    exact = distances(space, objective)
    landmark_cut = LandmarkCut(goal_facts(objective, SYMBOLS), relaxed_operators(SYMBOLS))
    if length is not None:
        assert exact[0] == length
    for number, steps in exact.items():
        state = space.state(number)
        assert landmark_cut(facts(state, SYMBOLS)) <= steps
        assert least_actions(state, objective, SYMBOLS) <= steps
        assert (steps == 0) == satisfied(state, objective)


@pytest.mark.parametrize(
    ("goals", "fault"),
    [
        (["(held-by a left)", "(held-by a right)"], "one place only"),
        (["(held-by a left)", "(held-by c left)"], "two things"),
        (["(held-by a left)", "(empty left)"], "two things, or one while it is empty"),
        (["(held a)", "(empty left)", "(empty right)"], "1 box to hold"),
        (["(held desk)"], "unknown box 'desk'"),
        (["(opened a)"], r"is not a goal \(accepted: \(held box\), \(held-by box gripper\)"),
    ],
)
def test_goals_that_cannot_be(goals: list[str], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        validate_objective(parse_objective(goals), SYMBOLS, START)


def changed(**changes: object) -> Instruction:
    return replace(SWAP, **changes)


@pytest.mark.parametrize(
    ("instruction", "line"),
    [
        (changed(name=""), "instructions: '' is not a name"),
        (changed(name="pick"), "instructions: 'pick' is declared twice"),
        (changed(parameters=(g, h, Type("lid")("b"))), "b is of unknown type 'lid'"),
        (changed(parameters=(b, g, h)), "parameters: the first is not a gripper"),
        (changed(parameters=(g, g, b)), "'gripper' is declared twice"),
        (changed(precondition=(holds(h, b),)), "does not say what gripper holds"),
        (changed(precondition=(free(g), holds(h, t))), "table is not a parameter"),
        (changed(precondition=(free(g), held(h))), "other is of type 'gripper'"),
        (changed(precondition=(free(g), Atom("helt", (b,)))), "unknown predicate 'helt'"),
        (changed(precondition=(free(g), Atom("held", (b, g)))), "held of 2 (accepted: of 1)"),
        (changed(precondition=(free(g), ~same(g, h))), "does not say what box hangs on"),
        (changed(precondition=(free(g), held(b))), "does not say what box hangs on"),
        (changed(effect=()), "effect: 0 of attach"),
        (changed(effect=(attach(b, g), attach(b, h))), "effect: 2 of attach"),
        (changed(effect=(attach(h, g),)), "other is of type 'gripper', which has no parent"),
        (changed(precondition=(holds(g, b),)), "gripper may hold something already"),
        (changed(effect=(attach(b, g), near(h))), "near: other is of type 'gripper'"),
        (changed(effect=(attach(b, g), ~free(g))), "free follows from what hangs on what"),
        (changed(contact=(hold(g, k),)), "contact, hold: tool is not a parameter"),
        (changed(motion=(drag(b, by=k),)), "motion, drag: tool is not a parameter"),
        (changed(motion=(drag("b"),)), "motion, drag: 'b' is not a parameter"),
    ],
)
def test_what_cannot_be_served_is_refused(instruction: Instruction, line: str) -> None:
    with pytest.raises(InputError) as caught:
        replace(HOOKS, instructions=(*HOOKS.instructions[:-1], instruction))
    assert line in str(caught.value)
    assert str(caught.value).startswith("hooks.py: ")
    assert len(str(caught.value).splitlines()) == 1


def test_other_declarations_that_cannot_be_served() -> None:
    lid = Type("lid", parents=(Type("pot"),))
    cases: tuple[tuple[dict[str, Any], str], ...] = (
        ({"types": (Table, Box)}, "no type 'gripper'"),
        ({"types": (*HOOKS.types, lid)}, "type lid: unknown type 'pot'"),
        ({"goal_types": (GoalType("sunk", (b,), ()),)}, "goal type sunk, condition: is empty"),
        ({"goal_types": (GoalType("in", (b,), (carries(b, t),)),)}, "table is not a parameter"),
        ({"facts": (near, FactType("held", (b,)))}, "is a predicate of every domain"),
        ({"facts": ()}, "unknown predicate 'near'"),
        (
            {"instructions": (replace(PULL, precondition=(holds(g, k), on(b, k))),)},
            r"precondition: table may be box, or on it .accepted: ~carries.box, table",
        ),
        (
            {"goal_types": (GoalType("at", (b, t), (on(b, t),), numbers=numbers("x")),)},
            "goal type at, final: is empty .accepted: one or more terms, for the numbers",
        ),
    )
    for changes, line in cases:
        with pytest.raises(InputError, match=line):
            replace(HOOKS, **changes)
    onto_tool = Instruction("onto", (g, b, k), (holds(g, k),), (attach(k, b),))
    with pytest.raises(InputError, match="holds: tool is not a parameter"):
        replace(HOOKS, instructions=(replace(onto_tool, parameters=(g, b)),))
    narrow = Type("lid", parents=(Gripper,))
    lid = narrow("lid")
    cover = Instruction("cover", (g, lid, t), (holds(g, lid),), (attach(lid, t),))
    with pytest.raises(InputError, match=r"a lid does not hang on a table \(accepted: gripper\)"):
        Domain("lids", (Gripper, Table, narrow), (cover,), ())
