"""Terms: found by name, refused where unknown, their kernels against their checks."""

from dataclasses import replace

import pytest

from guided_lgp.bounds.terms import find_term, term_names
from guided_lgp.bounds.vocabulary import check_terms
from guided_lgp.domains import domain_names, load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import Domain
from guided_lgp.logic.declarations import GoalType, Instruction, Term, Type, attach, holds, terms


def _with_contact(*contact: Term) -> Domain:
    domain = load_domain()
    first, *others = domain.instructions
    return replace(domain, instructions=(replace(first, contact=contact), *others))


@pytest.mark.parametrize("name", domain_names())
def test_every_domain_declares_known_terms(name: str) -> None:
    check_terms(load_domain(name))


def test_every_file_is_a_term() -> None:
    assert {"hold", "pads", "stand", "balanced", "beside", "clear", "apart"} <= set(term_names())
    assert {"level", "carried", "present", "steady"} <= set(term_names())
    assert all(find_term(name).add for name in term_names())


def test_an_unknown_term_is_refused_by_name() -> None:
    hand, box = load_domain().instructions[0].parameters
    fault = r"\.py: instruction grasp, contact: glue: is an unknown term .*apart, balanced"
    with pytest.raises(InputError, match=fault):
        check_terms(_with_contact(Term("hold", (hand, box)), Term("glue", (hand, box))))


def test_a_term_with_other_arguments_is_refused_by_name() -> None:
    hand, box = load_domain().instructions[0].parameters
    for term in (Term("hold", (hand,)), Term("hold", (hand, box, box))):
        with pytest.raises(
            InputError, match=r"grasp, contact: hold: .*argument.*accepted: gripper, box"
        ):
            check_terms(_with_contact(term))


def test_a_term_of_what_it_does_not_take_is_refused() -> None:
    hand, box = load_domain().instructions[0].parameters
    with pytest.raises(InputError, match=r"hold: box is of type 'box' .accepted: gripper"):
        check_terms(_with_contact(Term("hold", (box, hand))))


def test_a_parent_that_no_term_attaches_to_is_refused() -> None:
    domain = load_domain()
    hand, box = domain.instructions[0].parameters
    drawer = Type("drawer")
    chest = Type("box", also=box.type.also, parents=(*box.type.parents, drawer))
    put = Instruction(
        "put",
        (hand, chest("box"), drawer("drawer")),
        precondition=(holds(hand, chest("box")),),
        effect=(attach(chest("box"), drawer("drawer")),),
    )
    types = (hand.type, *box.type.also, chest, drawer)
    fault = r"instruction put, effect: no term attaches a box to a drawer .*a table by stand"
    with pytest.raises(InputError, match=fault):
        check_terms(Domain("drawers", types, (put,), ()))


def test_terms_stand_where_they_may() -> None:
    domain = load_domain()
    _, box = domain.instructions[0].parameters
    (upright,) = terms("upright")
    goals = GoalType("level", (box,), final=(upright(box),))
    for changed, fault in (
        (replace(domain, goal_types=(goals,)), "goal type level, final: upright: is an unknown"),
        (_with_contact(upright(box)), "instruction grasp, contact: upright: is an unknown"),
    ):
        with pytest.raises(InputError, match=fault):
            check_terms(changed)
