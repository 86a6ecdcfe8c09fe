"""Free motions optimised: shorter and smoother, without a rest where a straight line begins.

A free motion is a cubic spline through waypoints q_1:N; the straight lines beside it are kept. With
q_0 and q_N+1 its ends, S its first length, h = S / (N + 1), and joints in units of W = 1 / velocity
limit (so that lengths are times at full speed, in s), it minimises length and smoothness,

    sum_i |W (q_i+1 - q_i)|^2 / h + tau^2 sum_i |W (q_i+1 - 2 q_i + q_i-1)|^2 / h^3.

Where a straight line precedes or follows, its direction gives one more point beyond the end, so
that the spline goes on along the line. Motions of two actions that follow each other without a step
in between are one: the arm need not go home on the way. Constraints are the joint limits and, for
every waypoint and the pairs of bodies nearest to each other there, the distance d and the tilt z
(the vertical in the tool frame, kept on level motions), both linearised about the last iterate p:

    d(p_i) + d'(p_i) (q_i - p_i) >= clearance - slack_i,    z(p_i) + z'(p_i) (q_i - p_i) = z_0.

CasADi derives this quadratic program once; every motion only fills in its numbers. An iterate
counts if its whole spline passes the collision checker; of several the roomiest is taken, up to the
distance that is wished, where it takes hardly longer.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from guided_lgp.bounds.collision import PADDING
from guided_lgp.bounds.path.motions import Motion, Mover, Transit
from guided_lgp.bounds.path.quadratic import (
    NEIGHBOURS,
    WAYPOINTS,
    QuadraticProgram,
    quadratic_program,
)
from guided_lgp.bounds.path.situation import Step
from guided_lgp.bounds.path.spaces import STEP
from guided_lgp.bounds.path.spline import Cubic
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm, PlacedArm

CLEARANCE = 0.012
"""Distance (m) of bodies at the waypoints of motions that keep ``PADDING``, and as much more as is
wished beyond that: between waypoints a spline comes nearer."""
ROUNDS = 5
"""Quadratic programs per motion, at most."""
LEVEL = 0.01
"""How far (in sines) the vertical may turn in the tool frame on a level motion."""
_TRUST = 0.3
"""Largest change (rad) of a joint in a round that linearises constraints."""
_CONVERGED = 0.03
"""Change (rad) below which another round is not worth its time."""
_NARROWER = 0.001
"""How much nearer (m) a motion may come to something than at its ends, before it makes a detour."""
_SLOWER = 1.02
"""How many times as long a motion may take that keeps a larger distance."""
_SHORTEST = 0.05
"""Shortest motion (s at full speed) that is optimised."""
_INSET, _NEAR_LIMIT = 0.02, 0.005
"""Distance (rad) from the joint limits, of the waypoints and of the spline, which overshoots."""
_FINE = 200
"""Points at which the length of a spline is measured."""


def optimise(mover: Mover, steps: Iterable[Step]) -> list[Step]:
    """Optimise the free motions of a plan and join them with the straight lines beside them.

    Motions of one arm that follow each other, no other step in between, stay as they are where
    the optimised ones would not be faster.
    """
    result: list[Step] = []
    for _, group in groupby(steps, key=lambda s: s.gripper if isinstance(s, Motion) else ""):
        run = list(group)
        motions = [step for step in run if isinstance(step, Motion)]
        faster = _joined(mover, motions)
        result += faster if _duration(faster) < _duration(motions) else run
    return result


def _duration(motions: Sequence[Motion]) -> float:
    return sum(float(motion.timed[0][-1]) for motion in motions)


def _joined(mover: Mover, motions: Sequence[Motion]) -> list[Motion]:
    """The free motions optimised, those that succeed joined with the lines before and after."""
    pieces = [list(piece) for _, piece in groupby(motions, key=_freedom)]
    paths = [np.concatenate([p[0].path, *(m.path[1:] for m in p[1:])]) for p in pieces]
    lines = {i: paths[i] for i, piece in enumerate(pieces) if piece[0].transit is None}
    optimised: dict[int, Array] = {}
    for i, piece in enumerate(pieces):
        transit = piece[0].transit
        if transit is not None:
            path = optimal_path(mover, transit, paths[i], lines.get(i - 1), lines.get(i + 1))
            optimised |= {} if path is None else {i: path}
    result: list[Motion] = []
    for i, piece in enumerate(pieces):
        new = [Motion(piece[0].arm, optimised[i])] if i in optimised else piece
        if (i in optimised and i - 1 in lines) or (i in lines and i - 1 in optimised):
            new = [
                Motion(piece[0].arm, np.concatenate([result.pop().path, new[0].path[1:]])),
                *new[1:],
            ]
        result += new
    return result


def _freedom(motion: Motion) -> bool | None:
    """What a motion may be, None for a straight line.

    Free motions that follow each other have the same surroundings, so they are one.
    """
    return None if motion.transit is None else motion.transit.keep_level


def optimal_path(
    mover: Mover,
    transit: Transit,
    path: Array,
    before: Array | None,
    after: Array | None,
    inset: float = _NEAR_LIMIT,
) -> Array | None:
    """The best free spline (m, n) found between the ends of a path, or None.

    The first round has no constraints but the joint limits: most motions are then done. The
    others start again from the path, in steps for which the linearisation holds.

    Args:
        mover: checks it.
        transit: what it must keep clear of, and whether it is level.
        path: (m, n) from which to start.
        before: the straight line that leads to its first configuration, if there is one.
        after: the one that begins at its last.
        inset: distance (rad) from the joint limits that the spline keeps.
    """
    placed = mover.arms[transit.surroundings.scene.gripper]
    arm = placed.arm
    lengths = np.linalg.norm(np.diff(path, axis=0) * _weights(arm), axis=1)
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    if s[-1] < _SHORTEST:
        return None
    spline = _Spline(
        np.linspace(0.0, s[-1], WAYPOINTS + 2),
        None if before is None else _direction(arm, before[-2], before[-1]),
        None if after is None else _direction(arm, after[0], after[1]),
        arm.metric,
    )
    points = np.stack([np.interp(spline.knots, s, joint) for joint in path.T], axis=1)
    vertical = placed.forward(path[0])[0][2] if transit.keep_level else None
    limits, program = arm.limits, quadratic_program(mover.robot, arm.mirror_of or arm.gripper)
    enough = mover.room(transit.surroundings, path[[0, -1]], mover.clearance) - _NARROWER
    clearance = CLEARANCE + (mover.clearance - PADDING)
    best: _Iterate | None = None
    for number in range(ROUNDS):
        linearised = transit.keep_level or number > 0
        last, inner = points, points[1:-1]
        near = mover.distances(transit.surroundings, inner, NEIGHBOURS) if linearised else None
        found = _round(program, spline, last, near, clearance, arm, vertical)
        if found is None:
            break
        moved = np.concatenate([last[:1], found, last[-1:]])
        candidate = spline.sampled(moved)
        clear = (
            np.all((candidate > limits[:, 0] + inset) & (candidate < limits[:, 1] - inset))
            and (vertical is None or _turned(placed, candidate, vertical) < LEVEL)
            and mover.collision(transit.surroundings, candidate) is None
        )
        if clear:
            room = mover.room(transit.surroundings, candidate, enough)
            iterate = _Iterate(Motion(arm, candidate), room)
            best = iterate if best is None or iterate.is_better_than(best) else best
            if np.abs(moved - last).max() < _CONVERGED if linearised else room >= enough:
                break
        points = moved if linearised or clear else last
    return None if best is None else best.motion.path


@dataclass(frozen=True)
class _Iterate:
    """A spline that is free."""

    motion: Motion
    room: float
    """Its smallest distance (m), up to the one that is wished."""

    def is_better_than(self, other: "_Iterate") -> bool:
        """Whether it is roomier and hardly slower, or much faster; the later one of two with the
        same room has converged more.
        """
        if self.room > other.room:
            return _duration([self.motion]) <= _SLOWER * _duration([other.motion])
        if self.room == other.room:
            return True
        return _SLOWER * _duration([self.motion]) < _duration([other.motion])


def _weights(arm: Arm) -> Array:
    """W (n,) in s/rad."""
    return 1.0 / arm.velocity_limits


def _direction(arm: Arm, start: Array, end: Array) -> Array:
    """Of a line in joint space; its length is 1 s at full speed."""
    return np.asarray((end - start) / np.linalg.norm((end - start) * _weights(arm)))


def _turned(arm: PlacedArm, path: Array, vertical: Array) -> float:
    """How far the vertical turns in the tool frame along a path (m, n)."""
    return float(np.abs(arm.forward(path)[0][:, 2] - vertical).max())


@dataclass(frozen=True)
class _Spline:
    """What all splines of one motion share."""

    knots: Array
    """(WAYPOINTS + 2,) s at full speed."""
    out: Array | None
    """Derivative (n,) at the start; None where the motion begins at rest."""
    into: Array | None
    """The same for the end."""
    metric: Array
    """(n,) m per rad."""

    def sampled(self, points: Array) -> Array:
        """Through (WAYPOINTS + 2, n), at steps that are short enough for collision checks."""
        curve = Cubic(self.knots, points, self.out, self.into)
        fine = np.linspace(0.0, self.knots[-1], _FINE)
        ways = np.sum(np.abs(np.diff(curve(fine), axis=0)) * self.metric, axis=1)
        way = np.concatenate([[0.0], np.cumsum(ways)])
        marks = np.linspace(0.0, way[-1], 2 + int(way[-1] / STEP))
        path = curve(np.interp(marks, way, fine))
        path[0], path[-1] = points[0], points[-1]
        return path


def _round(
    program: QuadraticProgram,
    spline: _Spline,
    last: Array,
    near: tuple[Array, Array] | None,
    clearance: float,
    arm: Arm,
    vertical: Array | None,
) -> Array | None:
    """Solve the quadratic program of one round.

    Args:
        program: the quadratic program of the arm.
        spline: its knots and the slopes at its ends.
        last: the iterate (WAYPOINTS + 2, n) with both ends.
        near: distances (WAYPOINTS, NEIGHBOURS) and gradients (..., n); None to leave them out,
            and the trust region with them.
        clearance: the least distance (m) there.
        arm: whose motion it is; a mirror image is solved as the original.
        vertical: (3,) in the tool frame, where it is to be kept.

    Returns:
        the next waypoints (WAYPOINTS, n), or None if the solver fails.
    """
    h, sign, limits = float(spline.knots[1]), arm.signs, arm.limits
    inner = last[1:-1]
    low = np.full_like(inner, limits[:, 0] + _INSET)
    high = np.full_like(inner, limits[:, 1] - _INSET)
    gradients = np.zeros((WAYPOINTS, NEIGHBOURS, len(sign)))
    least = np.full((WAYPOINTS, NEIGHBOURS), -np.inf)
    if near is not None:
        distances, gradients = near
        least = clearance - distances + np.einsum("imj,ij->im", gradients, inner)
        low, high = np.maximum(low, inner - _TRUST), np.minimum(high, inner + _TRUST)
    before = last[0] if spline.out is None else last[0] - h * spline.out
    after = last[-1] if spline.into is None else last[-1] + h * spline.into
    flags = [spline.out is not None, spline.into is not None, vertical is not None]
    upright = (
        np.zeros(3)
        if vertical is None
        else vertical * (1.0, 1.0 if arm.mirror_of is None else -1.0, 1.0)
    )
    rows = (*last * sign, before * sign, after * sign, (gradients * sign).ravel())
    bounds = np.sort(np.stack([low * sign, high * sign]), axis=0).reshape(2, -1)
    slack = np.full(WAYPOINTS, np.inf)
    solution = program.solve(
        p=np.concatenate([*rows, upright, flags, [h]]),
        lbx=np.concatenate([bounds[0], -slack]),
        ubx=np.concatenate([bounds[1], slack]),
        lbg=least.ravel(),
    )
    return None if solution is None else solution[: inner.size].reshape(inner.shape) * sign
