"""Inverse kinematics for starts: over a grid of poses, pitches and candidates at once.

Arms built like a human's are solved by formulas of their own, as compiled code; others by the
general inverse kinematics.
"""

from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.closed_form import inverse
from guided_lgp.bounds.program.grasp import Hand, tool_target, tool_targets
from guided_lgp.bounds.program.kinematics import ArmKinematics, Chain, RobotKinematics
from guided_lgp.bounds.program.slots import HeldBox
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Robot
from guided_lgp.robots.inverse import inverse_kinematics

_SHOULDER_JOINTS = 4
"""The joints that move most of the arm; the wrist turns at no cost."""
INPUTS = 16 + _SHOULDER_JOINTS
"""Arguments of a closed form, see :func:`_closed_form`."""
_MISSING = 20.0
"""Cost per m that is missing to reach: 5 cm, about a hand's way out of reach, cost 1."""
_BEYOND = 5.0
"""Cost per rad beyond joint limits: they can be mended by turning the hand about the box."""
_MOTION = 0.05
"""Cost per rad^2 of shoulder and elbow from the arm's side: only among what is reached."""
_PANS = np.linspace(-0.55, 1.6, 10)
"""Values (rad) of the shoulder's pan that are tried, left arm: from the middle to its own side."""
_VALUES = 12
"""Values of the redundant joint of any other arm, spread over its range."""
_TURN = 2 * np.pi


class Grid(NamedTuple):
    """Arguments of a closed form: every pose with every pitch, end and candidate."""

    candidates: Array
    """(C, 20) arguments of which those below are still to be filled in."""
    grasp: Array
    """(5,) offset, depth, half length, half height, turn."""
    poses: Array
    """(N, 4) x, y, yaw and z of the box."""
    pitches: Array
    """(M,)."""
    ends: Array
    """(E, 2) back along the approach and up."""

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Numbers of poses, pitches, ends and candidates."""
        return len(self.poses), len(self.pitches), len(self.ends), len(self.candidates)

    def arguments(self) -> Array:
        """All of them (N, M, E, C, 20)."""
        filled = np.empty((*self.shape, INPUTS))
        filled[...] = self.candidates
        filled[..., :4] = self.poses[:, None, None, None]
        filled[..., 4] = self.pitches[:, None, None]
        filled[..., 5:7] = self.grasp[:2]
        filled[..., 11] = self.ends[:, 1, None]
        filled[..., 12:15] = self.grasp[2:]
        filled[..., 15] = self.ends[:, 0, None]
        return filled


class ClosedForms(Protocol):
    """Evaluates the closed forms of chains."""

    def hold(self, chain: str, grid: Grid, extra: Array) -> Array:
        """Joints (E, n) at the first pose and pitch, of the candidate of least cost.

        The costs are those of all ends together, and some extra cost (C,) of each candidate.
        """
        ...

    def least_costs(self, chain: str, grid: Grid) -> Array:
        """The least of these costs (N, M), without anything extra."""
        ...


Extra = Callable[[int], Array]
"""What so many candidates (C,) cost besides; nothing of it is negative."""


class StartIk(Protocol):
    """Inverse kinematics of one arm for starts, in the convention of its chain."""

    def least_costs(
        self, held: HeldBox, hand: Hand, poses: Array, pitches: Array, ends: Array
    ) -> Array:
        """The least costs of holding a box at poses.

        Args:
            held: the grasp's lengths and turn.
            hand: offset of the tool along its z axis, and depth (m).
            poses: (N, 4) x, y, yaw and z of the box.
            pitches: (M,) of the approach (rad).
            ends: (E, 2) back along the approach and up (m); the first is the contact.

        Returns:
            costs (N, M) of what is missing, of limits, and of the way, over all candidates. One
            candidate is one motion.
        """
        ...

    def hold(
        self, held: HeldBox, hand: Hand, place: Array, pitch: Array, ends: Array, extra: Extra
    ) -> Array:
        """Joints (E, n) within their limits that hold a box at one place (1, 4) by one pitch (1,).

        Of the candidate of least cost, where each costs something ``extra``.
        """
        ...


class ClosedForm:
    """By the formulas of a human-like arm, for several pans and both elbows."""

    def __init__(
        self, arm: ArmKinematics, lifted: float, forms: ClosedForms, flat: Callable[[], StartIk]
    ) -> None:
        self._flat = flat
        self._chain = arm.chain.name
        self._forms = forms
        self._candidates = np.zeros((2 * len(_PANS), INPUTS))
        self._candidates[:, 7] = np.tile(_PANS, 2)
        self._candidates[:, 8] = np.repeat([1.0, -1.0], len(_PANS))
        self._candidates[:, 9:11] = arm.side, lifted
        self._candidates[:, 16:] = arm.home[:_SHOULDER_JOINTS]

    def least_costs(
        self, held: HeldBox, hand: Hand, poses: Array, pitches: Array, ends: Array
    ) -> Array:
        """See :class:`StartIk`."""
        if held.side.flat:  # the formulas are for fingers that close on upright sides
            return self._flat().least_costs(held, hand, poses, pitches, ends)
        return self._forms.least_costs(self._chain, self._grid(held, hand, poses, pitches, ends))

    def hold(
        self, held: HeldBox, hand: Hand, place: Array, pitch: Array, ends: Array, extra: Extra
    ) -> Array:
        """See :class:`StartIk`."""
        if held.side.flat:
            return self._flat().hold(held, hand, place, pitch, ends, extra)
        grid = self._grid(held, hand, place, pitch, ends)
        return self._forms.hold(self._chain, grid, extra(len(self._candidates)))

    def _grid(self, held: HeldBox, hand: Hand, poses: Array, pitches: Array, ends: Array) -> Grid:
        grasp = np.array([*hand, held.side.half_length, held.half_height, held.side.turn])
        return Grid(self._candidates, grasp, poses, pitches, ends)


class General:
    """By the general inverse kinematics, for several values of a redundant joint."""

    def __init__(self, robot: Robot, arm: ArmKinematics, fixed: tuple[float, ...]) -> None:
        self._arm, self._home = arm.arm, arm.home
        self._limits = np.array(arm.limits).T
        self._low, self._high = arm.arm.limits.T
        joints = (joint.joint for joint in robot.fixed_joints.values())
        values = dict(zip(joints, fixed, strict=True))
        self._solver = inverse_kinematics(robot, arm.arm.gripper, values)
        self._mounting = robot.mounting
        self._values = self._solver.redundancies(_VALUES)

    def least_costs(
        self, held: HeldBox, hand: Hand, poses: Array, pitches: Array, ends: Array
    ) -> Array:
        """See :class:`StartIk`."""
        return np.asarray(self._holds(held, hand, poses, pitches, ends)[1].min(axis=2))

    def hold(
        self, held: HeldBox, hand: Hand, place: Array, pitch: Array, ends: Array, extra: Extra
    ) -> Array:
        """See :class:`StartIk`."""
        joints, costs = self._holds(held, hand, place, pitch, ends)
        chosen = (costs[0, 0] + extra(costs.shape[-1])).argmin()
        return np.asarray(joints[0, 0, :, chosen])

    def _holds(
        self, held: HeldBox, hand: Hand, poses: Array, pitches: Array, ends: Array
    ) -> tuple[Array, Array]:
        """Joints (N, M, E, C, n) and costs (N, M, C) of candidates.

        Every branch at the contact goes on on the nearest at the ends.
        """
        rotation, position = tool_targets(held, hand, poses, pitches, ends, self._arm.palm_front)
        q, missing = self._solver.nearest(
            self._mounting.T @ rotation[..., None, :, :],
            position[..., None, :] @ self._mounting,
            self._values,
        )
        joints, lost = self._followed(q, missing)
        candidates = (*joints.shape[:3], -1)
        joints = self._arm.signs * joints  # in the convention of the chain
        within = np.clip(joints, *self._limits)
        values, limited = (np.moveaxis(array, -1, 0) for array in (joints, within))
        costs = _cost(values, limited, lost, self._home[:_SHOULDER_JOINTS])
        costs = costs.reshape(candidates).sum(axis=2)
        return within.reshape(*candidates, joints.shape[-1]), costs

    def _followed(self, q: Array, missing: Array) -> tuple[Array, Array]:
        """For every branch at the contact, the nearest one at each end.

        Args:
            q: (N, M, E, values, branches, n) solutions.
            missing: (N, M, E, values, branches) how far they are off.
        """
        contact, others = q[:, :, :1, :, :, None], q[:, :, :, :, None]
        near = others + _TURN * np.round((contact - others) / _TURN)
        near = np.where((near >= self._low) & (near <= self._high), near, others)
        lost = np.broadcast_to(missing[:, :, :, :, None], near.shape[:-1])
        distance = np.abs(near - contact).sum(axis=-1) + _LOST * lost
        best = np.argmin(distance, axis=-1)[..., None]
        joints = np.take_along_axis(near, best[..., None], axis=-2)[..., 0, :]
        return joints, np.take_along_axis(lost, best, axis=-1)[..., 0]


_LOST = 100.0
"""Weight (rad/m) of what is missing against the way from the contact, in choosing branches."""


def start_ik(
    kinematics: RobotKinematics, fixed: tuple[float, ...], forms: ClosedForms
) -> dict[str, StartIk]:
    """The inverse kinematics of every arm, by gripper.

    Args:
        kinematics: of the robot.
        fixed: values of the joints that the scene sets.
        forms: evaluates closed forms.
    """
    closed = closed_form_arms(kinematics)
    found: dict[str, StartIk] = {}
    for gripper, arm in kinematics.arms.items():
        general = cache(partial(General, kinematics.robot, arm, fixed))
        found[gripper] = (
            ClosedForm(arm, _lifted(arm.chain, fixed), forms, general)
            if arm.chain.name in closed
            else general()
        )
    return found


def _lifted(chain: Chain, fixed: tuple[float, ...]) -> float:
    """How far (m) the joints that the scene sets raise the shoulder."""
    on_chain = {joint.name for joint in chain.joints}
    return sum(value for name, value in zip(chain.fixed, fixed, strict=True) if name in on_chain)


@cache
def closed_form_arms(kinematics: RobotKinematics) -> dict[str, ArmKinematics]:
    """An arm of each of those chains of a robot that have a closed form, by the chain's name."""
    arms = {arm.chain.name: arm for arm in kinematics.arms.values()}
    return {name: arm for name, arm in arms.items() if arm.chain.human_like is not None}


@cache
def closed_forms(kinematics: RobotKinematics) -> dict[str, Any]:
    """The closed forms of these chains, as CasADi functions."""
    return {name: _closed_form(arm) for name, arm in closed_form_arms(kinematics).items()}


def _cost(joints: Iterable[Any], within: Iterable[Any], missing: Any, home: Iterable[Any]) -> Any:
    """Of values of joints, their values within the limits, and what is missing to reach (m)."""
    joints = list(joints)
    beyond = sum(abs(value - limited) for value, limited in zip(joints, within, strict=True))
    motion = sum((value - side) ** 2 for value, side in zip(joints, home, strict=False))
    return _BEYOND * beyond + _MISSING * missing + _MOTION * motion


def _closed_form(arm: ArmKinematics) -> Any:
    """CasADi function of one closed-form inverse kinematics.

    Inputs (16,): pose (x, y, yaw) and height of the box; pitch, offset, depth; shoulder pan,
    branch, side; lift of the shoulder; lift above the box's place; half length, half height, turn,
    distance back; the first joints at the arm's side.
    Outputs (8,): joint values within their limits (mirrored for a mirror image) and the cost.
    """
    x, lengths = ca.SX.sym("x", INPUTS), arm.chain.human_like
    assert lengths is not None
    position, rotation = tool_target(x[:3], x[3] + x[11], x[4:7], x[12:16], arm.chain.palm_front)
    solution = inverse(lengths, position, rotation, x[7], x[8], x[9], x[10])
    joints, (low, high) = solution[:-1], np.array(arm.limits).T
    within = ca.fmin(ca.fmax(joints, low), high)
    values, limited = (ca.vertsplit(part) for part in (joints, within))
    cost = _cost(values, limited, solution[-1], ca.vertsplit(x[16:]))
    return ca.Function(f"closed_form_{arm.chain.name}", [x], [ca.vertcat(within, cost)])
