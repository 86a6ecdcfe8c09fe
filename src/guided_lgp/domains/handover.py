"""Pick-and-place with hand-overs: a gripper takes a box out of another gripper."""

from guided_lgp.domains.pick_and_place import DOMAIN as PICK_AND_PLACE
from guided_lgp.domains.pick_and_place import Gripper, b, g
from guided_lgp.logic.declarations import Instruction, attach, clear, free, holds, same, terms
from guided_lgp.logic.domain import Domain

giver = Gripper("giver")

apart, hold, pads, present = terms("apart hold pads present")
transit, line_in, switch, line_out, home = terms("transit line_in switch line_out home")

take = Instruction(
    "take",
    (g, giver, b),
    precondition=(free(g), holds(giver, b), ~same(g, giver), clear(b)),
    effect=(attach(b, g),),
    contact=(present(b, by=giver), hold(giver, b), hold(g, b), pads(g, b), apart(g, giver)),
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

DOMAIN = Domain(
    "handover",
    types=PICK_AND_PLACE.types,
    instructions=(*PICK_AND_PLACE.instructions, take),
    goal_types=PICK_AND_PLACE.goal_types,
    further_goals=PICK_AND_PLACE.further_goals,
    extends=PICK_AND_PLACE,
)
