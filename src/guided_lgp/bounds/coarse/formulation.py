"""From a skeleton to the nonlinear program: an interpreter of what instructions declare.

Each action's terms add their variables and rows in declared order. Then its effect changes the mode
tree, and with it what always holds: every configuration of an arm keeps clear of everything but
what it holds and apart from the other arms, a hand whose box carries others keeps it level, and
every stack is balanced. An arm stands at its side, except while the box that it holds carries
others.
"""

from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.program.arrays import Instance, Program
from guided_lgp.bounds.program.context import Context, Line, Start
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.program.slots import ArmConfiguration, HeldBox, KeyframeSlots
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import find_term, kernel_table
from guided_lgp.bounds.terms.apart import keep_apart
from guided_lgp.bounds.terms.clear import keep_clear
from guided_lgp.logic import Action, Skeleton, successor


@dataclass(frozen=True)
class Formulation:
    """The program of a skeleton, and what its variables mean."""

    program: Program
    constants: Array
    instances: tuple[Instance, ...]
    grips: tuple[HeldBox, ...]
    choices: tuple[Start, ...]
    """What starts choose, in order; then they choose the grips."""
    at_switch: tuple[KeyframeSlots, ...]
    after_action: tuple[KeyframeSlots, ...]


class Formulator:
    """Builds the program of one skeleton."""

    def __init__(self, geometry: SceneGeometry, margins: Margins) -> None:
        robot = kinematics_of(geometry.scene.robot.description)
        self._context = Context(geometry, robot, kernel_table(robot), margins)

    def build(self, skeleton: Skeleton) -> Formulation:
        """The program of a skeleton whose actions are applicable one after the other.

        Raises:
            UngraspableError: no side of a box to grasp is narrow enough.
        """
        context = self._context
        at_switch, after_action = [], []
        for action in skeleton:
            at_switch.append(self._contact(action))
            self._switch(action)
            after_action.append(context.keyframe())
        return Formulation(
            program=context.program.build(),
            constants=np.array(context.program.constants),
            instances=tuple(context.program.instances),
            grips=tuple(context.grips),
            choices=tuple(choice for choices in context.choices for choice in choices),
            at_switch=tuple(at_switch),
            after_action=tuple(after_action),
        )

    def _contact(self, action: Action) -> KeyframeSlots:
        """What the action declares for its switch."""
        context = self._context
        context.begin(successor(context.state, action), _lines(action))
        for name, symbols in _contact(action):
            self._add(name, *symbols)
        if action.table is not None:
            self._keep_standing_arms_clear(action.gripper, action.box)
        return context.keyframe()

    def _switch(self, action: Action) -> None:
        """The effect on the mode tree, and what holds because of it."""
        context, body = self._context, action.box
        parent = action.gripper if action.table is None else action.table
        support = context.state.support_of(body)
        held = context.held.pop(body, None)
        if held is not None:
            del context.hands[held.gripper]
        if parent in context.robot.arms:
            context.held[body] = context.hands[parent]
            if context.state.carried_by(body):
                self._add("level", body)
        if support is not None and (below := context.after.support_of(support)) is not None:
            self._add("balanced", support, below)
        context.end()

    def _add(self, name: str, *symbols: str) -> None:
        """A term, and the surroundings of the configurations that it adds."""
        find_term(name).add(self._context, *symbols)
        for configuration in self._context.take_added():
            self._keep_free(configuration)

    def _keep_free(self, configuration: ArmConfiguration) -> None:
        """Keep an arm clear of tables, level boxes and the other arms."""
        context, gripper = self._context, configuration.held.gripper
        ends = (segment.joints for segment in configuration.segments)
        for joints in (configuration.joints, *ends):
            for name in (*context.geometry.tables, *context.geometry.boxes):
                if name != configuration.held.box and not context.at_side(name):
                    keep_clear(context, gripper, joints, name)
            for other in context.others(gripper):
                if joints is configuration.joints or other in context.standing:
                    keep_apart(context, gripper, joints, other, context.joints(other))

    def _keep_standing_arms_clear(self, actor: str, body: str) -> None:
        """Of what has been put down."""
        for gripper, standing in self._context.standing.items():
            if gripper != actor:
                keep_clear(self._context, gripper, standing.joints, body)


def _contact(action: Action) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """The terms of an action at its contact keyframe."""
    g, b, t = action.gripper, action.box, action.table
    if t is None:
        return ("pads", (g, b)), ("hold", (g, b)), ("beside", (b,))
    return (
        ("present", (t,)),
        ("stand", (b, t)),
        ("balanced", (b, t)),
        ("beside", (b, t)),
        ("hold", (g, b)),
    )


def _lines(action: Action) -> tuple[Line, ...]:
    """The straight ways of an action's motion."""
    if action.table is None:
        return Line(action.gripper, 0.09, 0.0), Line(action.gripper, 0.0, 0.04)
    return Line(action.gripper, 0.0, 0.08), Line(action.gripper, 0.09, 0.0)
