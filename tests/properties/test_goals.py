"""Goals and objectives: accepted exactly if some arrangement of the boxes fulfils them."""

import io
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from itertools import product

import pytest
from bad_input import EXAMPLE, UNICODE_NAMES, answer, examples
from hypothesis import given
from hypothesis import strategies as st

from guided_lgp import cli
from guided_lgp.domains import load_domain
from guided_lgp.logic import (
    Goal,
    Objective,
    State,
    format_objective,
    format_skeleton,
    parse_objective,
    parse_skeleton,
    satisfied,
    validate_objective,
)
from guided_lgp.robots import load_robot
from guided_lgp.scene import Scene

DOMAIN = load_domain()
GRIPPERS = load_robot("pr2").grippers
BOXES, TABLES = ("red", "green", "blue"), ("tab1", "tab2")
words = st.one_of(
    st.sampled_from((*BOXES, *TABLES, *GRIPPERS, "held", "on", "place", "shelf", *UNICODE_NAMES)),
    st.text(max_size=6),
)


def accepted(check: Callable[[], None], *names: str) -> bool:
    """Whether a check passes; if not, it says so in one line."""

    def passed() -> bool:
        check()
        return True

    return answer(passed, *names) is not None


phrases = st.one_of(
    st.text(max_size=30),
    st.lists(words, max_size=5).map(lambda found: f"({' '.join(found)})"),
    st.lists(words, max_size=5).map(" ".join),
)
"""Goals as somebody might type them: well formed or not."""


def arrangements() -> list[State]:
    """Every state of three boxes, two tables and two grippers, found by trying them all."""
    found = []
    for places in product((*TABLES, *BOXES, *GRIPPERS), repeat=len(BOXES)):
        where = dict(zip(BOXES, places, strict=True))
        held = {box: place for box, place in where.items() if place in GRIPPERS}
        if len(set(held.values())) == len(held) and not circular(where):
            support = {box: place for box, place in where.items() if box not in held}
            found.append(load_domain().state(support, held))
    return found


def circular(where: dict[str, str]) -> bool:
    """Whether some box stands on itself, through others or not."""
    ends = BOXES
    for _ in BOXES:
        ends = tuple(where.get(place, place) for place in ends)
    return not set(ends).isdisjoint(BOXES)


STATES = arrangements()


def fulfillable(texts: Sequence[str], start: State) -> bool:
    """Whether the goals, given as text, name known symbols, can all hold, and do not hold yet."""
    wanted = [text.strip("()").split() for text in texts]
    for _, *symbols in wanted:
        known = [symbols[0] in BOXES, *(table in (*TABLES, *BOXES) for table in symbols[1:])]
        if not all(known):
            return False

    def holds(state: State) -> bool:
        support, held = dict(state.support), dict(state.held)
        return all(
            symbols[0] in held if kind == "held" else support.get(symbols[0]) == symbols[1]
            for kind, *symbols in wanted
        )

    return bool(wanted) and any(map(holds, STATES)) and not holds(start)


boxes = st.sampled_from((*BOXES, *BOXES, *BOXES, "tab1", "pr2L", "shelf"))
tables = st.sampled_from((*BOXES, *TABLES, *BOXES, *TABLES, "pr2R", "shelf"))
goals = st.one_of(
    st.builds("(held {})".format, boxes), st.builds("(on {} {})".format, boxes, tables)
)


@examples(500)
@given(texts=st.lists(goals, max_size=5))
def test_objectives_are_accepted_exactly_if_they_can_be_fulfilled(
    scene: Scene, texts: list[str]
) -> None:
    def read() -> Objective:
        objective = parse_objective(texts)
        validate_objective(objective, scene.symbols, scene.state)
        return objective

    objective = answer(read, "goal", "objective")
    assert (objective is not None) == fulfillable(texts, scene.state)
    if objective is not None:
        assert any(satisfied(state, objective) for state in STATES)


@examples(400)
@given(texts=st.lists(phrases, max_size=3))
def test_anything_typed_as_a_goal(texts: list[str]) -> None:
    objective = answer(lambda: parse_objective(texts), *(repr(text) for text in texts))
    if objective is not None:
        again = [str(goal) for goal in objective]
        assert parse_objective(again) == objective
        assert format_objective(objective) == " ".join(again)
        for goal in objective:
            known = (goal.kind, len(goal.symbols)) in (("held", 1), ("on", 2))
            assert accepted(partial(DOMAIN.goal_type, goal), "goal") == known


@examples(100)
@given(names=st.lists(st.sampled_from(BOXES), unique=True), unknown=st.integers(0, 60))
def test_circles_and_too_many_held(names: list[str], unknown: int, scene: Scene) -> None:
    """Boxes on each other in a circle, and as many in the hands, some of them not in the scene."""
    every = [*names, *(f"box{index}" for index in range(unknown))]
    circle = [Goal("on", pair) for pair in zip(every, [*every[1:], *every[:1]], strict=True)]
    held = [Goal("held", (name,)) for name in every]

    def valid(goals: list[Goal]) -> bool:
        check = partial(validate_objective, tuple(goals), scene.symbols, scene.state)
        return accepted(check, "goal", "objective")

    assert not valid(circle)
    assert valid(held) == (unknown == 0 and len(names) in (1, 2))


actions = st.builds(
    "({} {} {})".format,
    st.sampled_from(("grasp", "place", "push", "Grasp")),
    st.sampled_from(("pr2L", "pr2R", "pr2L pr2R")),
    st.sampled_from(("red", "red tab1", "red green", "")),
)
remains = st.sampled_from((" ", ";", "(", ")", "grasp", "\n", "x"))


@examples(200)
@given(text=phrases | st.lists(actions | remains, max_size=6).map("".join))
def test_anything_read_as_a_sequence(text: str) -> None:
    """What is read as a skeleton is one from its first character to its last."""
    skeleton = answer(lambda: parse_skeleton(text), "action")
    if skeleton is not None:
        for action in skeleton:
            known = (action.instruction, len(action.symbols)) in (("grasp", 2), ("place", 3))
            assert accepted(partial(DOMAIN.instruction, action), "action") == known
        assert format_skeleton(skeleton).replace(" ", "") == "".join(text.split())


@examples(60)
@given(texts=st.lists(phrases, min_size=1, max_size=2))
def test_the_command_line_says_it_in_one_line(texts: list[str], scene: Scene) -> None:
    options = [word for text in texts for word in ("--goal", text)]
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
        cli.main(["plan", str(EXAMPLE), "--planner", "breadth-first", *options, "--params", "none"])
    assert ended.value.code == 2
    assert out.getvalue() == ""
    assert err.getvalue().startswith("error: ")
    assert err.getvalue().count("\n") == 1
