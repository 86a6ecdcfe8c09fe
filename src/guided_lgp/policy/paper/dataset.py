"""The training samples ((g, s_k), a_{k+1}) (paper, Sec. II and Appendix; DESIGN §5)."""

import zlib
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from guided_lgp.documents import read_json, write_json, written_whole
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import Objective, Symbols, parse_objective
from guided_lgp.policy.arrays import FloatArray, IntArray
from guided_lgp.policy.paper.encoding import CHAINS, INSTRUCTIONS, VERSION, Encoding

_SAMPLES = "samples.npz"
_DOCUMENT = "dataset.json"
_STAGE = "build_dataset"
_COLUMNS = ("instruction", "gripper", "box", "table")

_REMEDY = f"the output of the stage {_STAGE}"

_ARRAYS = {
    "states": np.float32,
    "actions": np.int8,
    "supports": np.int8,
    "configuration": np.int32,
    "goals": np.float32,
    "sample_state": np.int32,
    "sample_goals": np.int32,
}

_DAMAGE = (
    *(OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, MemoryError),
    *(BadZipFile, RuntimeError, zlib.error, TokenError),
)
"""What NumPy, zipfile and zlib raise for damaged archives."""


@dataclass(frozen=True)
class Dataset:
    """Samples as indices into the states of the sequences and into the encoded objectives.

    A sequence serves many objectives and its states are stored once.
    """

    encoding: Encoding
    symbols: Symbols
    objectives: tuple[Objective, ...]
    """The training objectives."""
    configurations: tuple[str, ...]
    """The training configurations."""
    states: FloatArray
    """(M, state_size) the encoded states s_k of all sequences."""
    actions: NDArray[np.int8]
    """(M, 4) classes of the action that follows: instruction, gripper, box, table (-1: none)."""
    supports: NDArray[np.int8]
    """(M, boxes) what each box stands on before it, in the order of the slots: a class of table,
    or -1 - g if gripper g holds the box."""
    configuration: NDArray[np.int32]
    """(M,) index of the configuration."""
    goals: FloatArray
    """(G, goals · goal_size) the encoded objectives, in both orders of their goals."""
    sample_state: NDArray[np.int32]
    """(N,) index of each sample's state."""
    sample_goals: NDArray[np.int32]
    """(N,) index of each sample's encoded objective."""

    def __len__(self) -> int:
        return len(self.sample_state)

    def of_network(self, network: str) -> IntArray:
        """The samples that a network is trained on: all, or those of its instruction."""
        if network not in INSTRUCTIONS:
            return np.arange(len(self))
        instruction = self.actions[self.sample_state, 0]
        return np.flatnonzero(instruction == INSTRUCTIONS.index(network))

    def tensors(
        self, network: str, sub_policy: str, samples: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Inputs and classes of one sub-policy, with the true previous decisions (DESIGN §5).

        Args:
            network: ``instruction``, ``grasp`` or ``place``.
            sub_policy: a member of the network's chain.
            samples: indices of samples.

        Returns:
            (n, inputs) and (n,).
        """
        state = self.sample_state[samples]
        blocks = [self.goals[self.sample_goals[samples]], self.states[state]]
        for name in CHAINS[network]:
            classes = self.actions[state, _COLUMNS.index(name)].astype(np.int64)
            if name == sub_policy:
                return np.concatenate(blocks, axis=1), classes
            if self.encoding.chain:
                blocks.append(np.eye(self.encoding.classes(name), dtype=np.float32)[classes])
        raise KeyError(sub_policy)

    def class_names(self, sub_policy: str) -> tuple[str, ...]:
        """The names of a sub-policy's classes."""
        return {
            "instruction": INSTRUCTIONS,
            "gripper": self.symbols.grippers,
            "box": self.symbols.boxes,
            "table": self.symbols.tables,
        }[sub_policy]

    def save(self, directory: Path) -> None:
        """Write ``samples.npz`` and ``dataset.json``; the same bytes for the same samples."""
        with written_whole(directory / _SAMPLES) as unfinished:
            np.savez_compressed(unfinished, **{name: getattr(self, name) for name in _ARRAYS})
        document = {
            "version": VERSION,
            "samples": len(self),
            "grippers": self.symbols.grippers,
            "boxes": self.symbols.boxes,
            "surfaces": self.symbols.surfaces,
            "objectives": [[str(goal) for goal in objective] for objective in self.objectives],
            "configurations": self.configurations,
            "encoding": self.encoding.document(),
        }
        write_json(directory / _DOCUMENT, document)


def load_dataset(directory: Path) -> Dataset:
    """Read what :meth:`Dataset.save` wrote.

    Raises:
        InputError: a file is missing, damaged, or of another version.
    """
    path = directory / _DOCUMENT
    document = read_json(path, _REMEDY)
    stored = document.get("encoding") if isinstance(document, dict) else None
    encoding = Encoding.parse(stored, str(path), _STAGE)
    try:
        symbols = load_domain().symbols(
            gripper=_names(document["grippers"]),
            box=_names(document["boxes"]),
            table=_names(document["surfaces"]),
        )
        objectives = tuple(parse_objective(_names(goals)) for goals in document["objectives"])
        configurations = _names(document["configurations"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(str(path), f"does not describe a data set: {error}", _REMEDY) from None
    counts = (len(symbols.grippers), len(symbols.boxes), len(symbols.surfaces))
    if counts != (encoding.grippers, encoding.boxes, encoding.surfaces):
        raise InputError(str(path), "has other numbers of symbols than its encoding", _REMEDY)
    path = directory / _SAMPLES
    try:
        with np.load(path, allow_pickle=False) as arrays:
            samples = {name: arrays[name] for name in arrays.files}
    except _DAMAGE as error:
        fault = "is missing" if isinstance(error, FileNotFoundError) else f"is damaged: {error}"
        raise InputError(str(path), fault, _REMEDY) from None
    wrong = _fault(samples, encoding, len(configurations))
    if wrong is not None:
        raise InputError(str(path), wrong, _REMEDY)
    return Dataset(encoding, symbols, objectives, configurations, **samples)


def _names(values: object) -> tuple[str, ...]:
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise TypeError("not a list of names")
    return tuple(values)


def _fault(samples: dict[str, Any], encoding: Encoding, configurations: int) -> str | None:
    """What is wrong with arrays that were read, if anything is."""
    if set(samples) != set(_ARRAYS):
        return f"has the arrays {', '.join(sorted(samples))}"
    states, goals = len(samples["states"]), len(samples["goals"])
    widths = {
        "states": (encoding.state_size,),
        "goals": (encoding.goals * encoding.goal_size,),
        "actions": (len(_COLUMNS),),
        "supports": (encoding.boxes,),
    }
    for name, array in samples.items():
        rows = {"goals": goals, "sample_state": -1, "sample_goals": -1}.get(name, states)
        shape = (len(array) if rows < 0 else rows, *widths.get(name, ()))
        if array.dtype != _ARRAYS[name] or array.shape != shape:
            return f"{name}: are {array.dtype} of shape {array.shape}"
        if not np.isfinite(array).all():
            return f"{name}: are not all finite"
    tables = encoding.classes("table")
    limits = {
        "actions": ([0, 0, 0, -1], [2, encoding.grippers, encoding.boxes, tables]),
        "supports": (-encoding.grippers, tables),
        "configuration": (0, configurations),
        "sample_state": (0, states),
        "sample_goals": (0, goals),
    }
    for name, (least, end) in limits.items():
        if ((samples[name] < least) | (samples[name] >= end)).any():
            return f"{name}: are out of range"
    places = samples["actions"][:, 0] == INSTRUCTIONS.index("place")
    if ((samples["actions"][:, 3] >= 0) != places).any():
        return "actions: a table without a placement, or the other way round"
    if len(samples["sample_state"]) != len(samples["sample_goals"]):
        return "sample_goals: not as many as sample_state"
    return None
