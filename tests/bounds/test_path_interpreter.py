"""Instructions that only this test declares are carried out."""

import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.results import PathResult
from guided_lgp.domains import pick_and_place as paper
from guided_lgp.logic import Action, Domain
from guided_lgp.logic.declarations import (
    Instruction,
    attach,
    carries,
    clear,
    free,
    held,
    holds,
    same,
    terms,
)
from guided_lgp.poses import compose, inverse
from guided_lgp.scene import Scene

g, b, t = paper.g, paper.b, paper.t
giver = paper.Gripper("giver")
pads, hold, beside, stand, balanced, present, apart = terms(
    "pads hold beside stand balanced present apart"
)
transit, line_in, switch, line_out, home = terms("transit line_in switch line_out home")

RAISE = Instruction(
    "raise",
    (g, b),
    precondition=(free(g), ~held(b)),
    effect=(attach(b, g),),
    contact=(pads(g, b), hold(g, b), beside(b)),
    motion=(present(b), transit(g), line_in(g, back=0.12), switch(close=g), line_out(g, up=0.05)),
)
LOWER = Instruction(
    "lower",
    (g, b, t),
    precondition=(holds(g, b), ~carries(b, t)),
    effect=(attach(b, t),),
    contact=(present(t), stand(b, t), balanced(b, t), beside(b, t), hold(g, b)),
    motion=(
        present(t),
        transit(g),
        line_in(g, down=0.05),
        switch(open=g),
        line_out(g, back=0.05, otherwise="up"),
        home(g),
    ),
)
RECEIVE = Instruction(
    "receive",
    (g, giver, b),
    precondition=(free(g), holds(giver, b), ~same(g, giver), clear(b)),
    effect=(attach(b, g),),
    contact=(present(b, by=giver), hold(giver, b), pads(g, b), hold(g, b), apart(g, giver)),
    motion=(
        present(b, by=giver),
        transit(g),
        line_in(g, back=0.09),
        switch(close=g, open=giver),
        line_out(giver, back=0.09),
        home(giver),
        home(g),
    ),
)
DOMAIN = Domain("test", paper.DOMAIN.types, (RAISE, LOWER, RECEIVE), ())


@pytest.fixture
def boxes(monkeypatch: pytest.MonkeyPatch) -> Scene:
    monkeypatch.setattr("guided_lgp.scene.model.load_domain", lambda name: DOMAIN)
    return scene(red=(0.5, 0.2, 0.65, 0.2, "tab1"), green=(0.5, -0.3, 0.65, 0.1, "tab2"))


def _solve(boxes: Scene, *actions: Action) -> PathResult:
    coarse = CoarseBound(boxes, 9)
    start = coarse.solve(actions)
    assert start.feasible, start.failure
    result = PathBound(boxes, coarse, 8).solve(start)
    assert result.feasible, result.failure
    return result


def test_lines_are_as_long_as_declared_and_an_arm_without_home_stays(boxes: Scene) -> None:
    result = _solve(boxes, Action("raise", ("pr2L", "red")))
    trajectory = result.trajectory
    assert trajectory is not None
    tools = boxes.robot.tool_poses(trajectory.q[:, :14])["pr2L"]
    (attachment,) = trajectory.attachments
    way = tools[-1, :3] - tools[attachment.start, :3]
    assert np.linalg.norm(way) == pytest.approx(0.05, abs=1e-3)
    assert way[2] > 0.02


def test_two_instructions_follow_each_other(boxes: Scene) -> None:
    actions = Action("raise", ("pr2R", "green")), Action("lower", ("pr2R", "green", "tab2"))
    trajectory = _solve(boxes, *actions).trajectory
    assert trajectory is not None
    assert trajectory.q[-1, :14] == pytest.approx(boxes.robot.description.home)


def test_a_body_goes_from_hand_to_hand(boxes: Scene) -> None:
    result = _solve(
        boxes,
        Action("raise", ("pr2L", "red")),
        Action("receive", ("pr2R", "pr2L", "red")),
        Action("lower", ("pr2R", "red", "tab2")),
    )
    trajectory = result.trajectory
    assert trajectory is not None
    given, taken = trajectory.attachments
    assert (given.gripper, taken.gripper) == ("pr2L", "pr2R")
    assert given.end == taken.start
    tools = boxes.robot.tool_poses(trajectory.q[[given.start, given.end], :14])
    grip = compose(inverse(tools["pr2L"][0]), result.at_switch[0].boxes["red"])
    shown = compose(tools["pr2L"][1], grip)
    assert result.at_switch[1].boxes["red"] == pytest.approx(shown, abs=1e-6)
