"""Collects the training samples from the enumerated sequences (paper, Appendix)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Objective,
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    format_objective,
    format_skeleton,
    parse_skeleton,
    satisfied,
    successor,
    unsatisfied,
)
from guided_lgp.params import SampleRecipe
from guided_lgp.policy.arrays import BoolArray, FloatArray, IntArray
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.documents import in_files
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.filling import Slots
from guided_lgp.scene import Scene
from guided_lgp.sequences import read_shortest, read_verdicts

_LEAST_DEVIATION = 1e-3  # m; less is no information, and scaling it up would be noise
_NONE = -1
PAPER = SampleRecipe()
_ENUMERATION = "the output of the stage enumerate_sequences for the same scenes"


def build_dataset(
    scenes: Sequence[Scene],
    sequences: Path,
    shortest: Path,
    objectives: Sequence[Objective],
    slack: int,
    recipe: SampleRecipe = PAPER,
    seed: int = 0,
) -> Dataset:
    """Collect the samples of the training configurations and objectives.

    For every configuration and objective these are the coarse-feasible sequences that reach the
    objective with their last action, of the shortest feasible length or up to ``slack`` longer.
    Each step is a sample, once for each order of the two goals.

    Args:
        scenes: the training configurations; they share their symbols.
        sequences: Parquet file of verdicts and states, written by enumerate_sequences.
        shortest: Parquet file of the shortest feasible lengths, from the same stage.
        objectives: the training objectives.
        slack: extra actions.
        recipe: what differs from the paper.
        seed: of the order of the boxes, in a recipe that draws it.

    Raises:
        InputError: a file is missing or does not fit the scenes; no sample results.
    """
    encoding = Encoding(
        chain=recipe.chain,
        named_first=recipe.boxes == "named_first",
        relative=recipe.relative,
        symbolic_state=recipe.symbolic_state,
    )
    symbols = _common_symbols(scenes, encoding)
    lengths = _shortest_lengths(shortest, scenes, objectives)
    columns = "configuration", "skeleton", "feasible", "states"
    verdicts = read_verdicts(sequences, *columns).to_pandas()
    feasible = verdicts[verdicts["feasible"]]
    rows_of = {str(name): rows for name, rows in feasible.groupby("configuration")}
    goals = _GoalCodes(objectives, symbols, encoding, recipe)
    declared, *_ = orders = _orders(encoding, symbols)

    states, actions, supports, configuration = [], [], [], []
    sample_state, sample_goals = [], []
    first = 0
    for index, scene in enumerate(scenes):
        rows = rows_of.get(scene.name, feasible.iloc[:0])
        slots = [declared] * len(rows)
        if recipe.boxes == "random":
            rng = np.random.default_rng(np.random.SeedSequence([seed, index]))
            slots = [orders[draw] for draw in rng.integers(len(orders), size=len(rows))]
        elif recipe.boxes == "named_first":  # the goals choose among all orders
            slots = [order for order in orders for _ in range(len(rows))]
            rows = pd.concat([rows] * len(orders))
        paths = _feasible_sequences(scene, rows, slots, encoding, str(sequences))
        wanted = _wanted(paths, objectives, lengths[index], slack)
        step, objective = np.nonzero(wanted[paths.sequence])
        codes = goals.rows(paths)[step, objective]
        sample, _ = np.nonzero(codes != _NONE)
        used, state = np.unique(step[sample], return_inverse=True)
        sample_state.append(first + state)
        sample_goals.append(codes[codes != _NONE])
        states.append(paths.states[used])
        actions.append(paths.actions[used])
        supports.append(paths.supports[used])
        configuration.append(np.full(len(used), index, dtype=np.int32))
        first += len(used)

    if not sum(map(len, sample_state)):
        fault = "no training objective has a feasible sequence"
        raise InputError(str(sequences), fault, _ENUMERATION)
    if recipe.normalised:
        encoding = _normalising(encoding, encoding.coordinates(np.concatenate(states)))
    encoded = encoding.coordinates(np.concatenate(states))
    if recipe.symbolic_state:
        places = encoding.encode_places(np.concatenate(supports))
        encoded = np.concatenate([encoded, places], axis=1)
    return Dataset(
        encoding=encoding,
        symbols=symbols,
        objectives=tuple(objectives),
        configurations=tuple(scene.name for scene in scenes),
        states=encoded,
        actions=np.concatenate(actions),
        supports=np.concatenate(supports),
        configuration=np.concatenate(configuration),
        goals=np.array(goals.codes),
        sample_state=np.concatenate(sample_state).astype(np.int32),
        sample_goals=np.concatenate(sample_goals).astype(np.int32),
    )


def _orders(encoding: Encoding, symbols: Symbols) -> list[Slots]:
    """The slots as declared, then with the bodies of each type in all other orders."""
    orders = []
    for kind in encoding.signature.kinds:
        own = encoding.signature.own(kind, symbols)
        movable = kind in encoding.signature.movable
        orders.append([(kind, order) for order in (permutations(own) if movable else [own])])
    return [Slots(own, goals=()) for own in product(*orders)]


@dataclass(frozen=True)
class _Sequences:
    """The feasible sequences of one configuration; the steps of all, one after another."""

    progress: list[tuple[State, ...]]
    """Symbolic states 0 to K of each sequence."""
    slots: list[Slots]
    """The slots of each sequence."""
    sequence: IntArray
    """(M,) the sequence that each step belongs to."""
    states: FloatArray
    """(M, position_size) world positions (m) of the slots before each step."""
    actions: NDArray[np.int8]
    """(M, decisions) classes of each step's action."""
    supports: NDArray[np.int8]
    """(M, bodies) what each body stands on before each step; see :class:`Dataset`."""


def _feasible_sequences(
    scene: Scene, rows: pd.DataFrame, slots: list[Slots], encoding: Encoding, where: str
) -> _Sequences:
    symbols = scene.symbols
    stored = (*symbols.grippers, *symbols.boxes, *symbols.surfaces)
    known: dict[Skeleton, tuple[State, ...]] = {(): (scene.state,)}

    def progress(skeleton: Skeleton) -> tuple[State, ...]:
        if skeleton not in known:
            before = progress(skeleton[:-1])
            if skeleton[-1] not in applicable_actions(before[-1], symbols):
                text = f"{scene.name}: {format_skeleton(skeleton)} is not applicable"
                raise InputError(where, text, _ENUMERATION)
            known[skeleton] = (*before, successor(before[-1], skeleton[-1]))
        return known[skeleton]

    try:
        skeletons = [parse_skeleton(text) for text in rows["skeleton"]]
    except InputError as error:
        raise InputError(where, f"skeletons of {scene.name}: {error}", _ENUMERATION) from None
    states = [np.zeros((0, encoding.position_size), dtype=np.float32)]
    for skeleton, flat, own in zip(skeletons, rows["states"], slots, strict=True):
        size = (len(skeleton) + 1) * encoding.position_size
        if flat is None or len(flat) != size or not np.isfinite(flat).all():
            raise InputError(where, f"states of {scene.name}: not {size} numbers", _ENUMERATION)
        positions = np.asarray(flat, np.float32).reshape(-1, len(stored), 3)[:-1]
        order = [stored.index(name) for name in own.symbols if name is not None]
        states.append(positions[:, order].reshape(-1, encoding.position_size))
    along = [progress(skeleton) for skeleton in skeletons]
    classes = [
        row
        for path, own in zip(skeletons, slots, strict=True)
        for row in encoding.encode_actions(own, path)
    ]
    supports = [
        encoding.encode_supports(own, state)
        for path, own in zip(along, slots, strict=True)
        for state in path[:-1]
    ]
    return _Sequences(
        progress=along,
        slots=slots,
        sequence=np.repeat(np.arange(len(skeletons)), [len(path) for path in skeletons]),
        states=np.concatenate(states),
        actions=np.array(classes, dtype=np.int8).reshape(-1, len(encoding.signature.decisions)),
        supports=np.array(supports, dtype=np.int8).reshape(-1, encoding.bodies),
    )


def _wanted(
    paths: _Sequences, objectives: Sequence[Objective], shortest: FloatArray, slack: int
) -> BoolArray:
    """(sequences, objectives): reaches the objective with its last action, and is short enough."""
    holds: dict[State, BoolArray] = {}
    for state in {state for states in paths.progress for state in states}:
        holds[state] = np.array([satisfied(state, objective) for objective in objectives])
    wanted = np.zeros((len(paths.progress), len(objectives)), dtype=bool)
    for row, states in enumerate(paths.progress):
        length = len(states) - 1
        wanted[row] = holds[states[-1]] & (shortest <= length) & (length <= shortest + slack)
        for state in states[:-1]:
            wanted[row] &= ~holds[state]
    return wanted


class _GoalCodes:
    """The distinct encoded objectives, and which of them each sample has."""

    def __init__(
        self,
        objectives: Sequence[Objective],
        symbols: Symbols,
        encoding: Encoding,
        recipe: SampleRecipe,
    ) -> None:
        self.codes: list[FloatArray] = []
        self._symbols = symbols
        self._objectives = objectives
        self._encoding = encoding
        self._recipe = recipe
        self._row: dict[bytes, int] = {}
        self._rows_in: dict[tuple[State, Slots], IntArray] = {}
        self._bodies: dict[tuple[State, Objective], tuple[str | None, ...]] = {}

    def rows(self, paths: _Sequences) -> IntArray:
        """(steps, objectives, 4) the rows in ``codes`` of each objective at each step.

        The last axis has the objective and the adapted objective, each in both orders, or -1, also
        where goals that choose the slots choose others.
        """
        per_step = [
            self._rows(state, slots)
            for path, slots in zip(paths.progress, paths.slots, strict=True)
            for state in path[:-1]
        ]
        return np.array(per_step, dtype=np.int64).reshape(-1, len(self._objectives), 4)

    def _rows(self, state: State, slots: Slots) -> IntArray:
        known = self._rows_in.get((state, slots))
        if known is None:
            known = np.full((len(self._objectives), 4), _NONE)
            for row, objective in zip(known, self._objectives, strict=True):
                row[:2] = self._orders(objective, slots, state)
                remaining = unsatisfied(state, objective)
                if self._recipe.adapted_goals and remaining not in ((), objective):
                    row[2:] = self._orders(remaining, slots, state)
            self._rows_in[state, slots] = known
        return known

    def _orders(self, goals: Objective, slots: Slots, state: State) -> tuple[int, int]:
        reverse = goals[::-1]
        other = self._code(reverse, slots, state) if self._recipe.both_orders else _NONE
        return self._code(goals, slots, state), other

    def _code(self, goals: Objective, slots: Slots, state: State) -> int:
        if self._encoding.named_first:
            movable = self._encoding.signature.movable
            if (state, goals) not in self._bodies:
                chosen = self._encoding.fill(goals, state, self._symbols)
                self._bodies[state, goals] = chosen.of(movable)
            if self._bodies[state, goals] != slots.of(movable):
                return _NONE
        code = self._encoding.encode_goals(replace(slots, goals=goals), state)
        if code.tobytes() not in self._row:
            self._row[code.tobytes()] = len(self.codes)
            self.codes.append(code)
        return self._row[code.tobytes()]


def _normalising(encoding: Encoding, states: FloatArray) -> Encoding:
    """The encoding with mean 0 and deviation 1 over states; what never moves keeps its scale."""
    deviation = states.std(axis=0, dtype=np.float64)
    scale = np.where(deviation < _LEAST_DEVIATION, 1.0, deviation)
    centre = states.mean(axis=0, dtype=np.float64)
    return replace(encoding, centre=tuple(centre.tolist()), scale=tuple(scale.tolist()))


def _common_symbols(scenes: Sequence[Scene], encoding: Encoding) -> Symbols:
    symbols = scenes[0].symbols
    for scene in scenes:
        if scene.symbols != symbols:
            raise InputError(
                f"scene {scene.name}",
                "has other symbols than the first training configuration",
                "training configurations with the same symbols",
            )
    counts = encoding.counts(symbols)
    if counts != encoding.slots:
        raise InputError(f"scene {scenes[0].name}", _text(counts), f"{_text(encoding.slots)} slots")
    return symbols


def _text(counts: Iterable[tuple[str, int]]) -> str:
    return ", ".join(f"{count} {in_files(kind)}" for kind, count in counts)


def _shortest_lengths(
    path: Path, scenes: Sequence[Scene], objectives: Sequence[Objective]
) -> FloatArray:
    """(scenes, objectives) shortest feasible lengths; NaN where there is none."""
    lengths = read_shortest(path, scenes, objectives)
    values = [
        [lengths[scene.name][format_objective(objective)] for objective in objectives]
        for scene in scenes
    ]
    return np.array(values, dtype=np.float32)  # None becomes NaN
