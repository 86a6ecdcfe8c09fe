"""The training samples ((g, s_k), a_{k+1}) (paper, Sec. II and Appendix)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guided_lgp.documents import read_json, write_json
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.logic import Objective, Symbols, parse_objective
from guided_lgp.policy.arrays import FloatArray, IntArray
from guided_lgp.policy.paper.documents import DatasetDocument, in_files
from guided_lgp.policy.paper.encoding import VERSION, Encoding
from guided_lgp.policy.paper.signature import INSTRUCTION
from guided_lgp.policy.tensors import Limits, Shape, read_arrays, require_range, write_tensors

_SAMPLES = "samples.safetensors"
_DOCUMENT = "dataset.json"
_STAGE = "build_dataset"
_REMEDY = f"the output of the stage {_STAGE}"


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
    """(M, decisions) classes of the action that follows: instruction, gripper, box, table for
    pick-and-place; -1 for what an instruction does not name."""
    supports: NDArray[np.int8]
    """(M, bodies) what each body stands on before it, in the order of the slots: a class of
    support, or -1 - g if gripper g holds it."""
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
        if network == INSTRUCTION:
            return np.arange(len(self))
        instruction = self.actions[self.sample_state, 0]
        return np.flatnonzero(instruction == self.encoding.signature.instructions.index(network))

    def tensors(
        self, network: str, sub_policy: str, samples: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Inputs and classes of one sub-policy, with the true previous decisions.

        Args:
            network: one of the encoding's chains.
            sub_policy: a member of the network's chain.
            samples: indices of samples.

        Returns:
            (n, inputs) and (n,).
        """
        state = self.sample_state[samples]
        blocks = [self.goals[self.sample_goals[samples]], self.states[state]]
        decisions = self.encoding.signature.decisions
        for name in self.encoding.chains[network]:
            classes = self.actions[state, decisions.index(name)].astype(np.int64)
            if name == sub_policy:
                return np.concatenate(blocks, axis=1), classes
            if self.encoding.chain:
                blocks.append(np.eye(self.encoding.classes(name), dtype=np.float32)[classes])
        raise KeyError(sub_policy)

    def class_names(self, sub_policy: str) -> tuple[str, ...]:
        """The names of a sub-policy's classes."""
        signature = self.encoding.signature
        if sub_policy == INSTRUCTION:
            return signature.instructions
        return self.symbols.of(signature.variables[sub_policy].type.name)

    def save(self, directory: Path) -> None:
        """Write ``samples.safetensors`` and ``dataset.json``; same samples, same bytes."""
        arrays = {name: getattr(self, name) for name in _declared(self.encoding)}
        digest = write_tensors(directory / _SAMPLES, arrays)
        document = {
            "version": VERSION,
            "samples": len(self),
            "digest": digest,
            **_names_of(self.symbols, self.encoding),
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
    validate = DatasetDocument.model_validate
    document = validated(validate, read_json(path, _REMEDY), str(path), _REMEDY)
    encoding = Encoding.parse(document.encoding, str(path), _STAGE)
    own = document.__pydantic_extra__
    names = {kind: own.get(in_files(kind), []) for kind, _ in encoding.slots}
    try:
        symbols = encoding.signature.domain.symbols(**names)
        objectives = tuple(map(parse_objective, document.objectives))
    except InputError as error:
        raise InputError(str(path), f"does not describe a data set: {error}", _REMEDY) from None
    if encoding.counts(symbols) != encoding.slots:
        raise InputError(str(path), "has other numbers of symbols than its encoding", _REMEDY)
    configurations = tuple(document.configurations)
    path = directory / _SAMPLES
    samples, sizes = read_arrays(path, _declared(encoding), _REMEDY, document.digest)
    decisions = encoding.signature.decisions
    limits: dict[str, Limits] = {
        "actions": ([0, *[-1] * (len(decisions) - 1)], [encoding.classes(d) for d in decisions]),
        "supports": (-encoding.holders, encoding.supports),
        "configuration": (0, len(configurations)),
        "sample_state": (0, sizes["states"]),
        "sample_goals": (0, sizes["goals"]),
    }
    require_range(path, samples, limits, _REMEDY)
    if not _named_alike(samples["actions"], encoding):
        fault = "name other symbols than their instructions do"
        raise InputError(f"{path}: actions", fault, _REMEDY)
    return Dataset(encoding, symbols, objectives, configurations, **samples)


def _names_of(symbols: Symbols, encoding: Encoding) -> dict[str, tuple[str, ...]]:
    """The own symbols of each logic type, by what files call them."""
    signature = encoding.signature
    return {in_files(kind): signature.own(kind, symbols) for kind in signature.kinds}


def _declared(encoding: Encoding) -> dict[str, tuple[type, Shape]]:
    """Type and shape of all arrays: of the states, of the encoded objectives, of the samples."""
    return {
        "states": (np.float32, ("states", encoding.state_size)),
        "actions": (np.int8, ("states", len(encoding.signature.decisions))),
        "supports": (np.int8, ("states", encoding.bodies)),
        "configuration": (np.int32, ("states",)),
        "goals": (np.float32, ("goals", encoding.goals * encoding.goal_size)),
        "sample_state": (np.int32, ("samples",)),
        "sample_goals": (np.int32, ("samples",)),
    }


def _named_alike(actions: NDArray[np.int8], encoding: Encoding) -> bool:
    """Whether each action names the symbols that its instruction does, and no others."""
    decisions = encoding.signature.decisions
    chains = [encoding.chains[name] for name in encoding.signature.instructions]
    named = np.array([[d == INSTRUCTION or d in chain for d in decisions] for chain in chains])
    return bool(((actions >= 0) == named[actions[:, 0]]).all())
