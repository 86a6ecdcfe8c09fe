import numpy as np
import pytest

from guided_lgp.bounds.path.steps import check_motions, manoeuvre
from guided_lgp.domains import domain_names, load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Domain
from guided_lgp.logic.declarations import Instruction, Term, Type, attach, free, held, terms

Gripper, Table = Type("gripper"), Type("table")
Box = Type("box", also=(Table,), parents=(Gripper, Table))
g, b = Gripper("gripper"), Box("box")
present, transit, line_in, switch, line_out, home, fly = terms(
    "present transit line_in switch line_out home fly"
)
MOTION = (present(b), transit(g), line_in(g, back=0.05), switch(close=g), line_out(g, up=0.1))


def domain(*motion: Term) -> Domain:
    snatch = Instruction("snatch", (g, b), (free(g), ~held(b)), (attach(b, g),), motion=motion)
    return Domain("test", (Gripper, Table, Box), (snatch,), ())


def test_a_motion_is_read_as_it_is_declared() -> None:
    bound = domain(*MOTION, home(g)).bind(Action("snatch", ("pr2L", "red")))
    read = manoeuvre(bound)
    assert (read.name, read.gripper, read.body, read.parent) == ("snatch", "pr2L", "red", "pr2L")
    assert (read.presented, read.closing, read.opening) == (("red",), "pr2L", None)
    assert read.homes == ("pr2L",)
    down = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # approach from above
    assert read.way_in.ways[0].of(down) == pytest.approx([0, 0, 0.05])
    assert read.way_out.ways[0].of(np.eye(3)) == pytest.approx([0, 0, 0.1])


def test_a_hand_that_lets_go_at_top_and_bottom_leaves_backwards() -> None:
    paper = load_domain("pick_and_place")
    place = manoeuvre(paper.bind(Action("place", ("pr2L", "red", "table"))))
    quarter = np.array(
        [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    )  # fingers close upright
    (back,) = place.ways_out(quarter)
    assert back.of(quarter) == pytest.approx([-0.09, 0, 0])
    assert len(place.ways_out(np.eye(3))) == 3
    grasp = manoeuvre(paper.bind(Action("grasp", ("pr2L", "red"))))
    assert grasp.ways_out(quarter) == grasp.way_out.ways


def test_other_ways_follow_the_declared_one() -> None:
    motion = (*MOTION[:2], line_in(g, down=0.05, otherwise="back"), *MOTION[3:])
    ways = manoeuvre(domain(*motion).bind(Action("snatch", ("pr2L", "red")))).way_in.ways
    assert [way.of(np.eye(3)).tolist() for way in ways] == [[0, 0, 0.05], [-0.05, 0, 0]]


@pytest.mark.parametrize("name", domain_names())
def test_every_domain_of_the_project_can_be_moved(name: str) -> None:
    check_motions(load_domain(name))


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (
            (*MOTION, fly(g)),
            "instruction snatch, motion: fly: is an unknown step (accepted: present,",
        ),
        (
            (MOTION[0], *MOTION[2:]),
            "snatch, motion: present, line_in, switch, line_out: are not the steps of a motion",
        ),
        (
            (home(g), *MOTION),
            "home, present, transit, line_in, switch, line_out: are",
        ),
        (
            (*MOTION[:2], line_in(g), *MOTION[3:]),
            "snatch, motion: line_in: has no direction",
        ),
        (
            (*MOTION[:2], line_in(g, left=0.1), *MOTION[3:]),
            "line_in: unknown option 'left'",
        ),
        ((*MOTION[:3], switch(), MOTION[4]), "switch: is not what the effect makes of the hands"),
        ((*MOTION[:4], line_out(b, up=0.1)), "line_out: box has no part in it (accepted: gripper)"),
        ((*MOTION, home()), "home: has 0 arguments (accepted: 1)"),
    ],
)
def test_a_motion_that_cannot_be_carried_out_is_refused(
    motion: tuple[Term, ...], message: str
) -> None:
    with pytest.raises(InputError) as refused:
        check_motions(domain(*motion))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
