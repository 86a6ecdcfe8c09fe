"""The training samples ((g, s_k), a_{k+1}) (paper, Sec. II and Appendix; DESIGN §5)."""

import json
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from guided_lgp.documents import write_json, written_whole
from guided_lgp.errors import InputError
from guided_lgp.logic import Objective, Symbols, parse_objective
from guided_lgp.policy.encoding import CHAINS, INSTRUCTIONS, VERSION, Encoding, FloatArray

_SAMPLES = "samples.npz"
_DOCUMENT = "dataset.json"
_STAGE = "build_dataset"
_COLUMNS = ("instruction", "gripper", "box", "table")

IntArray = NDArray[np.int64]


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
    configuration: NDArray[np.int16]
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
        """The meaning of a sub-policy's classes."""
        return {
            "instruction": INSTRUCTIONS,
            "gripper": self.symbols.grippers,
            "box": self.symbols.boxes,
            "table": self.symbols.tables,
        }[sub_policy]

    def save(self, directory: Path) -> None:
        """Write ``samples.npz`` and ``dataset.json``; the same bytes for the same samples."""
        with written_whole(directory / _SAMPLES) as unfinished:
            np.savez_compressed(
                unfinished,
                states=self.states,
                actions=self.actions,
                supports=self.supports,
                configuration=self.configuration,
                goals=self.goals,
                sample_state=self.sample_state,
                sample_goals=self.sample_goals,
            )
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
    remedy = f"the output of the stage {_STAGE}"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        stored = document["encoding"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(str(path), f"cannot be read: {error}", remedy) from None
    encoding = Encoding.parse(stored, str(path), _STAGE)
    path = directory / _SAMPLES
    try:
        with np.load(path, allow_pickle=False) as arrays:
            samples = {name: arrays[name] for name in arrays.files}
        return Dataset(
            encoding=encoding,
            symbols=Symbols(
                grippers=tuple(document["grippers"]),
                boxes=tuple(document["boxes"]),
                surfaces=tuple(document["surfaces"]),
            ),
            objectives=tuple(parse_objective(goals) for goals in document["objectives"]),
            configurations=tuple(document["configurations"]),
            **samples,
        )
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as error:
        raise InputError(str(path), f"cannot be read: {error}", remedy) from None
