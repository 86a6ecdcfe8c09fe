"""What the relational policy sees: symbols as nodes, what holds between them as edges.

Nodes are the symbols of logic type table: surfaces, then boxes. There is one graph per gripper, in
that gripper's own frame: mirrored such that the gripper is the left one. Renaming boxes permutes
the nodes, and mirroring the scene swaps the graphs, so that the policy need not learn either.

No feature counts anything, and positions are clipped to the range of the training data: more boxes
than in training, or higher towers, look like more of the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guided_lgp.logic import Domain, Objective, State, Symbols
from guided_lgp.policy.arrays import BoolArray, FloatArray, IntArray
from guided_lgp.policy.relational.geometry import BLIND, Sight, edge_inputs, node_inputs

NO_GOAL = -1
GOAL_HELD = -2

SETTLED = "settled: stands where it may stay, and so does all below it"
CARRIES = "carries a box"
CARRIES_ABOVE = "carries, directly or through others"
ELSEWHERE = "goal: stand elsewhere"
READY = "goal: stand elsewhere, on what is settled"

NODE_FEATURES = (
    "x",
    "y, on the other side",
    "z",
    "held by the gripper",
    "held by another gripper",
    "is a box",
    "goal: be held",
    ELSEWHERE,
    READY,
    "goal: holds",
    SETTLED,
    CARRIES,
    "carries, directly or through others, a box with an open goal",
    "gripper is free",
    "another gripper is free",
)
"""Inputs of every node; the last two are the same for all nodes of a graph."""

STANDS_ON, CARRIED = "stands on", "carries"
EDGE_FEATURES = (
    STANDS_ON,
    CARRIED,
    "stands on, directly or through others",
    CARRIES_ABOVE,
    "shall stand on",
)
"""Inputs of every ordered pair of nodes, from the first one's point of view."""


def sides(grippers: int) -> FloatArray:
    """Sign of y on each gripper's own side: they are declared left, then right."""
    return np.resize(np.array([1, -1], dtype=np.float32), grippers)


@dataclass(frozen=True)
class Situations:
    """Symbolic states with their positions and goals: B problems with the same numbers of symbols.

    Tables are numbered surfaces first, then boxes; n boxes and T tables.
    """

    positions: FloatArray
    """(B, T, 3) in m, in the world: of the centres, or of the middle of each bottom where there are
    shapes."""
    supports: IntArray
    """(B, n) what each box stands on; -1 - g when held by gripper g."""
    goals: IntArray
    """(B, n) what each box shall stand on, or :data:`GOAL_HELD`, or :data:`NO_GOAL`."""
    grippers: int
    shapes: FloatArray | None = None
    """(B, T, 4) half extents (m) and yaw (rad), for a policy that sees them."""

    def __getitem__(self, rows: IntArray | BoolArray) -> "Situations":
        positions, supports = self.positions[rows], self.supports[rows]
        shapes = None if self.shapes is None else self.shapes[rows]
        return Situations(positions, supports, self.goals[rows], self.grippers, shapes)


@dataclass(frozen=True)
class Graphs:
    """The inputs of the network; G graphs per problem, one for each gripper."""

    nodes: FloatArray
    """(B, G, T, node features), what is seen of sizes last."""
    edges: FloatArray
    """(B, T, T, edge features), the same for all grippers; what is seen of distances last."""
    held: IntArray
    """(B, G) the table number of the box that the gripper holds, or -1."""

    def carried_by(self, tables: IntArray) -> BoolArray:
        """(B, G, T) what stands on (B, G) tables, directly or through others."""
        carried = self.edges[..., EDGE_FEATURES.index(CARRIES_ABOVE)] > 0
        found: BoolArray = np.take_along_axis(carried, tables[..., None], axis=1)
        return found


@dataclass(frozen=True)
class Range:
    """Smallest and largest x, y and z in m that make a difference.

    Those of what stands in training; but on its own side a gripper reaches what it reaches in the
    middle, so that y, which is positive there, ends at 0.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @classmethod
    def of(cls, situations: Situations) -> "Range":
        """The range of all symbols that no gripper holds."""
        surfaces = situations.positions.shape[1] - situations.supports.shape[1]
        standing = np.pad(situations.supports >= 0, ((0, 0), (surfaces, 0)), constant_values=True)
        found = situations.positions[standing]
        lower, upper = found.min(axis=0), found.max(axis=0)
        lower[1], upper[1] = min(lower[1], -upper[1]), 0
        return cls(tuple(lower.tolist()), tuple(upper.tolist()))

    def scaled(self, positions: FloatArray) -> FloatArray:
        """Positions (..., 3) as numbers from -1 to 1."""
        lower, upper = (np.array(part, dtype=np.float32) for part in (self.lower, self.upper))
        return np.clip((2 * positions - lower - upper) / (upper - lower), -1, 1)


def situation(
    objective: Objective,
    state: State,
    positions: Mapping[str, NDArray[np.float64]],
    symbols: Symbols,
    shapes: Mapping[str, NDArray[np.float64]] | None = None,
) -> Situations:
    """One problem (B = 1).

    Args:
        objective: the goals; each box has at most one.
        state: the symbolic state.
        positions: world position (3,) in m of every symbol.
        symbols: grippers, boxes and surfaces.
        shapes: half extents (m) and yaw (rad), (4,), of all that has some.
    """
    tables = symbols.surfaces + symbols.boxes
    number = {name: index for index, name in enumerate(tables)}
    number |= {name: -1 - index for index, name in enumerate(symbols.grippers)}
    place = {box: number[where] for box, where in state.support + state.held}
    goals = {goal.symbols[0]: number.get(goal.symbols[-1], NO_GOAL) for goal in objective}
    goals |= {
        goal.symbols[0]: GOAL_HELD for goal in objective if is_held(symbols.domain, goal.kind)
    }
    where = np.array([[positions[name] for name in tables]], dtype=np.float32)
    forms = None
    if shapes is not None:
        forms = np.array([[shapes[name] for name in tables]], dtype=np.float32)
        where[..., 2] -= forms[..., 2]
    return Situations(
        positions=where,
        supports=np.array([[place[box] for box in symbols.boxes]]),
        goals=np.array([[goals.get(box, NO_GOAL) for box in symbols.boxes]]),
        grippers=len(symbols.grippers),
        shapes=forms,
    )


def is_held(domain: Domain, kind: str) -> bool:
    """Whether a goal of this type is that its body is held."""
    (condition,) = next(goal.condition for goal in domain.goal_types if goal.name == kind)
    return condition.predicate == "held"


def graphs(situations: Situations, limits: Range, sight: Sight = BLIND) -> Graphs:
    """Build the graphs of all problems, one per gripper, with what is seen of the geometry."""
    supports, goals = situations.supports, situations.goals
    boxes, tables = supports.shape[1], situations.positions.shape[1]
    holder = np.stack([supports == -1 - gripper for gripper in range(situations.grippers)], axis=1)
    free: BoolArray = ~np.logical_or.reduce(holder, axis=2)

    holds = np.where(goals == GOAL_HELD, supports < 0, supports == goals)
    goal_open = (goals != NO_GOAL) & ~holds
    on = _relation(supports, tables)
    above = _closure(on)
    shall = _relation(np.where(goal_open, goals, NO_GOAL), tables)

    def of_tables(of_boxes: BoolArray) -> FloatArray:
        surfaces = np.zeros((*of_boxes.shape[:-1], tables - boxes), dtype=np.float32)
        return np.concatenate([surfaces, of_boxes], axis=-1, dtype=np.float32)

    in_hand = of_tables(supports < 0)
    unsettled = np.maximum(of_tables(goal_open), in_hand)
    carried = np.swapaxes(above, 1, 2)
    settled = 1 - np.maximum(unsettled, _any(above, unsettled))
    symbolic = [
        of_tables(np.ones_like(holds)),
        of_tables(goal_open & (goals == GOAL_HELD)),
        of_tables(goal_open & (goals >= 0)),
        _any(shall, settled),
        of_tables(holds),
        settled,
        on.max(axis=1),
        _any(carried, of_tables(goal_open)),
    ]
    by_gripper = []
    for gripper, side in enumerate(sides(situations.grippers)):
        mirror = np.array([1, side, 1], dtype=np.float32)
        position = limits.scaled(situations.positions * mirror)
        position *= 1 - in_hand[..., None]  # whose hand it is says more
        by_other = np.logical_or.reduce(np.delete(holder, gripper, axis=1), axis=1)
        other_free = np.logical_or.reduce(np.delete(free, gripper, axis=1), axis=1)
        arms = [np.tile(flag[:, None], tables) for flag in (free[:, gripper], other_free)]
        hands = [of_tables(holder[:, gripper]), of_tables(by_other)]
        flags = np.stack([*hands, *symbolic, *arms], axis=-1, dtype=np.float32)
        by_gripper.append(np.concatenate([position, flags], axis=-1))
        if sight.nodes and situations.shapes is not None:
            seen = node_inputs(situations.shapes, float(side), sight)
            by_gripper[-1] = np.concatenate([by_gripper[-1], seen], axis=-1)
    relations = np.stack([on, np.swapaxes(on, 1, 2), above, carried, shall], axis=-1)
    if sight.edges and situations.shapes is not None:
        standing = of_tables(supports >= 0) > 0
        seen = edge_inputs(situations.positions, situations.shapes, standing, sight)
        relations = np.concatenate([relations, seen], axis=-1)
    return Graphs(
        nodes=np.stack(by_gripper, axis=1),
        edges=relations,
        held=np.where(free, -1, holder.argmax(axis=2) + tables - boxes),
    )


def _relation(targets: IntArray, tables: int) -> FloatArray:
    """(B, T, T) 1 from each box to its target; a negative target is none."""
    boxes = targets.shape[1]
    relation = np.zeros((len(targets), tables, tables), dtype=np.float32)
    relation[:, tables - boxes :] = targets[..., None] == np.arange(tables)
    return relation


def _closure(relation: FloatArray) -> FloatArray:
    """The transitive closure, by squaring until nothing is new."""
    wider = np.minimum(relation + relation @ relation, 1)
    while (wider != relation).any():
        relation = wider
        wider = np.minimum(relation + relation @ relation, 1)
    return relation


def _any(relation: FloatArray, flag: FloatArray) -> FloatArray:
    """(B, T) whether the flag holds for any node that a node is related to."""
    found: FloatArray = np.minimum((relation @ flag[..., None])[..., 0], 1)
    return found
