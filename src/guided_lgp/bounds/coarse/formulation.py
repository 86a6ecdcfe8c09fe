"""From a skeleton to the nonlinear program: an interpreter of what instructions declare.

Each action's terms add their variables and rows in declared order. Then its effect changes the mode
tree, and with it what always holds: every configuration of an arm keeps clear of everything but
what it holds and apart from the other arms, a hand whose box carries others keeps it level, and
every stack is balanced. An arm stands at its side, except while the box that it holds carries
others.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.coarse.compiler import kernel_shapes
from guided_lgp.bounds.coarse.variants import Variant
from guided_lgp.bounds.program.arrays import Instance, Program
from guided_lgp.bounds.program.context import LOW, Aim, Context, Line, Start
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.program.slots import ArmConfiguration, HeldBox, KeyframeSlots
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import find_term
from guided_lgp.bounds.terms.apart import keep_apart
from guided_lgp.bounds.terms.clear import surroundings
from guided_lgp.bounds.terms.hold import take_over
from guided_lgp.bounds.terms.steady import keep_steady
from guided_lgp.bounds.terms.term import GoalTerm
from guided_lgp.logic import Action, GroundInstruction, GroundTerm, Skeleton, successor


@dataclass(frozen=True)
class Formulation:
    """The program of a skeleton, and what its variables mean."""

    program: Program
    constants: Array
    instances: tuple[Instance, ...]
    grips: tuple[HeldBox, ...]
    configurations: Mapping[HeldBox, tuple[ArmConfiguration, ...]]
    """Of each grip."""
    choices: tuple[Start, ...]
    """What starts choose, in order; then they choose the grips."""
    at_switch: tuple[KeyframeSlots, ...]
    after_action: tuple[KeyframeSlots, ...]


class Formulator:
    """The program of a skeleton while it is walked, action by action."""

    def __init__(
        self, geometry: SceneGeometry, margins: Margins, lasting: Iterable[GroundTerm] = ()
    ) -> None:
        """Begin a program.

        Args:
            geometry: of the scene.
            margins: distances that it keeps.
            lasting: terms that hold all the time.
        """
        robot = geometry.scene.robot.description
        self._domain = geometry.domain
        self._context = Context(geometry, kinematics_of(robot), kernel_shapes(robot), margins)
        self._at_switch: tuple[KeyframeSlots, ...] = ()
        self._after_action: tuple[KeyframeSlots, ...] = ()
        for box, gripper in geometry.scene.held.items():
            take_over(self._context, gripper, box)
        for term in lasting:
            self._add(term.name, *term.symbols, **term.options)

    def build(
        self, skeleton: Skeleton, variant: Variant | None = None, final: Sequence[GroundTerm] = ()
    ) -> Formulation:
        """The program of a skeleton whose actions are applicable one after the other.

        Args:
            skeleton: from here on.
            variant: its discrete choices; the first of each if not given.
            final: terms that hold at the end.

        Raises:
            UngraspableError: no side of a box to grasp is narrow enough.
        """
        walk, variant = self._copy(), variant or Variant()
        last = {self._domain.bind(action).body: index for index, action in enumerate(skeleton)}
        walk._aim(final, last)
        for index, action in enumerate(skeleton):
            walk._act(action, *variant.at(index))
        for term in final:
            walk._context.action = last.get(term.symbols[0], len(skeleton) - 1)
            walk._add(term.name, *term.symbols, **term.options)
        return walk.formulation()

    def after(self, action: Action, side: int, low: bool) -> "Formulator":
        """With one more action; this one stays as it is.

        Args:
            action: which is applicable.
            side: on which of the sides that the hand can close on a new grip does.
            low: whether the way of its box is a low one.

        Raises:
            UngraspableError: no side of a box to grasp is narrow enough.
        """
        longer = self._copy()
        longer._act(action, side, low)
        return longer

    def formulation(self) -> Formulation:
        """The program so far."""
        context = self._context
        return Formulation(
            program=context.program.build(),
            constants=np.array(context.program.constants),
            instances=tuple(context.program.instances),
            grips=tuple(context.grips),
            configurations=dict(context.configurations),
            choices=tuple(choice for choices in context.choices for choice in choices),
            at_switch=self._at_switch,
            after_action=self._after_action,
        )

    def _copy(self) -> "Formulator":
        other = Formulator.__new__(Formulator)
        vars(other).update(vars(self))
        other._context = self._context.copy()
        return other

    def _act(self, action: Action, side: int, low: bool) -> None:
        """Walk one action further."""
        context, ground = self._context, self._domain.bind(action)
        context.begin(successor(context.state, action), straight_lines(ground.motion, low), side)
        self._at_switch += (self._contact(ground),)
        self._switch(ground)
        self._after_action += (context.keyframe(),)

    def _aim(self, final: Iterable[GroundTerm], last: Mapping[str, int]) -> None:
        """Let the last action on each body whose place matters aim at that place."""
        for term in final:
            box, _ = term.symbols
            if box in last:
                self._context.aims[last[box], box] = self._drawn(term)

    def _drawn(self, term: GroundTerm) -> Aim:
        goal, context = find_term(term.name), self._context
        assert isinstance(goal, GoalTerm)

        def aim(generator: np.random.Generator, count: int, below: Array) -> Array:
            return goal.draw(context, generator, count, *term.symbols, below, **term.options)

        return aim

    def _contact(self, ground: GroundInstruction) -> KeyframeSlots:
        """What the action declares for its switch."""
        context = self._context
        for term in ground.contact:
            self._add(term.name, *term.symbols, **term.options)
        if ground.parent not in context.robot.arms:
            self._keep_standing_arms_clear(ground.actor, ground.body)
        return context.keyframe()

    def _switch(self, ground: GroundInstruction) -> None:
        """The effect on the mode tree, and what holds because of it."""
        context, body = self._context, ground.body
        support = context.state.support_of(body)
        context.attach(body, ground.parent)
        if body in context.held and context.level(body, context.state):
            self._add("level", body)
        below = None if support is None else context.after.support_of(support)
        if support is not None and below is not None:
            self._add("balanced", support, below)
        keep_steady(context)
        context.end()

    def _add(self, name: str, *symbols: str, **options: object) -> None:
        """A term, and the surroundings of the configurations that it adds."""
        find_term(name).add(self._context, *symbols, **options)
        for configuration in self._context.take_added():
            self._keep_free(configuration)

    def _keep_free(self, configuration: ArmConfiguration) -> None:
        """Keep an arm clear of tables, level boxes and the other arms."""
        context, gripper = self._context, configuration.held.gripper
        ends = (segment.joints for segment in configuration.segments)
        about = surroundings(context, gripper, self._others(configuration.held.box))
        for joints in (configuration.joints, *ends):
            context.program.repeat(about, joints)
            for other in context.others(gripper):
                if joints is configuration.joints or other in context.standing:
                    keep_apart(context, gripper, joints, other, context.joints(other))

    def _others(self, box: str) -> list[str]:
        """All bodies but a box that are not at an arm's side."""
        context = self._context
        away = {box, *filter(context.at_side, context.held)}
        return [name for name in context.geometry.bodies if name not in away]

    def _keep_standing_arms_clear(self, actor: str, body: str) -> None:
        """Of what has been put down."""
        for gripper, standing in self._context.standing.items():
            if gripper != actor:
                about = surroundings(self._context, gripper, (body,))
                self._context.program.repeat(about, standing.joints)


def straight_lines(motion: Iterable[GroundTerm], low: bool = False) -> tuple[Line, ...]:
    """The straight ways of a motion to and from its switch.

    Args:
        motion: steps.
        low: whether ways along the vertical are low ones instead.
    """
    return tuple(_line(step, low) for step in motion if step.name in ("line_in", "line_out"))


def _line(step: GroundTerm, low: bool) -> Line:
    gripper, back = step.symbols[0], float(step.options.get("back", 0.0))
    up = float(step.options.get("down", 0.0)) + _SHARE * float(step.options.get("up", 0.0))
    return Line(gripper, *LOW) if low and up else Line(gripper, back, up)


_SHARE = 0.5
"""How much of a way up is asked for: halfway the hand may turn, the box is clear of its support."""
