"""The training samples ((g, s_k), a_{k+1}) (paper, Sec. II and Appendix)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from guided_lgp.documents import read_json, write_json
from guided_lgp.errors import InputError
from guided_lgp.faults import first_fault
from guided_lgp.logic import Objective, Symbols, parse_objective
from guided_lgp.policy.arrays import FloatArray, IntArray
from guided_lgp.policy.paper.documents import DatasetDocument, in_files
from guided_lgp.policy.paper.encoding import VERSION, Encoding
from guided_lgp.policy.paper.signature import INSTRUCTION
from guided_lgp.policy.tensors import read_tensors, write_tensors

_SAMPLES = "samples.safetensors"
_DOCUMENT = "dataset.json"
_STAGE = "build_dataset"
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
        arrays = {name: getattr(self, name) for name in _ARRAYS}
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
    try:
        document = DatasetDocument.model_validate(read_json(path, _REMEDY))
    except ValidationError as error:
        raise first_fault(error, str(path), _REMEDY) from None
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
    samples = read_tensors(path, _REMEDY, document.digest)
    wrong = _fault(samples, encoding, len(configurations))
    if wrong is not None:
        raise InputError(str(path), wrong, _REMEDY)
    return Dataset(encoding, symbols, objectives, configurations, **samples)


def _names_of(symbols: Symbols, encoding: Encoding) -> dict[str, tuple[str, ...]]:
    """The own symbols of each logic type, by what files call them."""
    signature = encoding.signature
    return {in_files(kind): signature.own(kind, symbols) for kind in signature.kinds}


def _fault(samples: dict[str, Any], encoding: Encoding, configurations: int) -> str | None:
    """What is wrong with arrays that were read, if anything is."""
    if set(samples) != set(_ARRAYS):
        return f"has the arrays {', '.join(sorted(samples))}"
    for name, array in samples.items():
        if not array.ndim:
            return f"{name}: is a single number"
    states, goals = len(samples["states"]), len(samples["goals"])
    widths = {
        "states": (encoding.state_size,),
        "goals": (encoding.goals * encoding.goal_size,),
        "actions": (len(encoding.signature.decisions),),
        "supports": (encoding.bodies,),
    }
    for name, array in samples.items():
        rows = {"goals": goals, "sample_state": -1, "sample_goals": -1}.get(name, states)
        shape = (len(array) if rows < 0 else rows, *widths.get(name, ()))
        if array.dtype != _ARRAYS[name] or array.shape != shape:
            return f"{name}: are {array.dtype} of shape {array.shape}"
        if not np.isfinite(array).all():
            return f"{name}: are not all finite"
    decisions = encoding.signature.decisions
    limits = {
        "actions": ([0, *[-1] * (len(decisions) - 1)], [encoding.classes(d) for d in decisions]),
        "supports": (-encoding.holders, encoding.supports),
        "configuration": (0, configurations),
        "sample_state": (0, states),
        "sample_goals": (0, goals),
    }
    for name, (least, end) in limits.items():
        if ((samples[name] < least) | (samples[name] >= end)).any():
            return f"{name}: are out of range"
    chains = [encoding.chains[name] for name in encoding.signature.instructions]
    named = np.array([[d == INSTRUCTION or d in chain for d in decisions] for chain in chains])
    if ((samples["actions"] >= 0) != named[samples["actions"][:, 0]]).any():
        return "actions: name other symbols than their instructions do"
    if len(samples["sample_state"]) != len(samples["sample_goals"]):
        return "sample_goals: not as many as sample_state"
    return None
