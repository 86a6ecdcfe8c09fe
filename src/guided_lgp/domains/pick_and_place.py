"""Pick-and-place, the domain of the paper (Sec. IV): boxes, tables, grasp and place.

The rules are the permissive ones of the original LGP: placing on a box that another gripper holds
and grasping a box with others on top are legal; geometry decides whether they are feasible.
"""

from guided_lgp.logic.declarations import (
    GoalType,
    Instruction,
    Type,
    attach,
    carries,
    free,
    held,
    holds,
    idle,
    numbers,
    on,
    terms,
)
from guided_lgp.logic.domain import Domain

Gripper, Table = Type("gripper"), Type("table")
Box = Type("box", also=(Table,), parents=(Gripper, Table))
g, b, t = Gripper("gripper"), Box("box"), Table("table")

pads, hold, beside = terms("pads hold beside")
stand, balanced, present = terms("stand balanced present")
at, within, upright, posture = terms("at within upright posture")
transit, line_in, switch, line_out, home = terms("transit line_in switch line_out home")

grasp = Instruction(
    "grasp",
    (g, b),
    precondition=(free(g), ~held(b)),
    effect=(attach(b, g),),
    contact=(pads(g, b), hold(g, b), beside(b)),
    motion=(
        present(b),
        transit(g),
        line_in(g, back=0.09),
        switch(close=g),
        line_out(g, up=0.08),
        home(g),
    ),
)
place = Instruction(
    "place",
    (g, b, t),
    precondition=(holds(g, b), ~carries(b, t)),
    effect=(attach(b, t),),
    contact=(present(t), stand(b, t), balanced(b, t), beside(b, t), hold(g, b)),
    motion=(
        present(t),
        transit(g),
        line_in(g, down=0.08),
        switch(open=g),
        line_out(g, back=0.09, otherwise="up"),
        home(g),
    ),
)

DOMAIN = Domain(
    "pick_and_place",
    types=(Gripper, Table, Box),
    instructions=(grasp, place),
    goal_types=(GoalType("held", (b,), (held(b),)), GoalType("on", (b, t), (on(b, t),))),
    further_goals=(
        GoalType("heldby", (b, g), (holds(g, b),)),
        GoalType("empty", (g,), (free(g),)),
        GoalType("handempty", (), (idle(),)),
        GoalType(
            "at",
            (b, t),
            (on(b, t),),
            numbers=numbers("x y z yaw", tolerance=0.01, turn=0.05),
            final=(at(b, t),),
            derived=t,
        ),
        GoalType("in", (b, t), (on(b, t),), numbers=numbers("x0 y0 x1 y1"), final=(within(b, t),)),
        GoalType("upright", (b,), lasting=(upright(b),)),
        GoalType("posture", (g,), series="joint", postures=(posture(g),)),
    ),
)
