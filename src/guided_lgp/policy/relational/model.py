"""The trained relational network: its files, and its scores without torch."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from guided_lgp.documents import read_json, write_json, written_whole
from guided_lgp.errors import InputError
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.relational.encoding import EDGE_FEATURES, NODE_FEATURES, Graphs, Range

VERSION = 1
NAME = "relational"
_REMEDY = f"version {VERSION}, the output of the stage train_relational"
_LARGEST = 1024
"""Width and rounds that a file may name."""


@dataclass(frozen=True)
class Weights:
    """The parameters of a trained network, by their names in torch."""

    limits: Range
    """Of the positions in training."""
    tensors: Mapping[str, FloatArray]

    @property
    def width(self) -> int:
        """Length of a node's state."""
        return len(self.tensors["embed.bias"])

    @property
    def rounds(self) -> int:
        """Rounds of message passing."""
        return sum(name.startswith("send.") for name in self.tensors)

    def scores(self, graphs: Graphs) -> FloatArray:
        """Scores of all actions; the counterpart of the network in torch.

        Returns:
            (B, G, T): of grasping each table by a gripper that is free, or of placing on each
            what it holds.
        """
        state = _relu(self._linear("embed", graphs.nodes))
        for index in range(self.rounds):
            sent = self._linear(f"send.{index}", state)[:, :, None]
            said = (sent + self._linear(f"edge.{index}", graphs.edges)).max(axis=3)
            heard = _relu(self._linear(f"receive.{index}", state) + said)
            hidden = self._linear(f"hidden.{index}", np.concatenate([state, heard], axis=-1))
            state = state + self._linear(f"update.{index}", _relu(hidden))
        whole = _relu(self._linear("pool", state)).max(axis=2, keepdims=True)
        parts = [state, np.broadcast_to(whole, state.shape)]
        grasp = self._head("grasp", parts)
        held = graphs.held[..., None, None]
        if (held < 0).all():
            return grasp
        in_hand = np.take_along_axis(state, held, axis=2)
        edges = np.take_along_axis(graphs.edges, held[..., None], axis=2)[:, :, 0]
        place = self._head("place", [*parts, np.broadcast_to(in_hand, state.shape), edges])
        return np.where(held[..., 0] < 0, grasp, place)

    def _head(self, name: str, parts: list[FloatArray]) -> FloatArray:
        hidden = _relu(self._linear(f"{name}.0", np.concatenate(parts, axis=-1)))
        return self._linear(f"{name}.2", hidden)[..., 0]

    def _linear(self, name: str, inputs: FloatArray) -> FloatArray:
        outputs: FloatArray = inputs @ self.tensors[f"{name}.weight"].T
        bias = self.tensors.get(f"{name}.bias")
        return outputs if bias is None else outputs + bias


def _relu(values: FloatArray) -> FloatArray:
    return np.maximum(values, 0)


def shapes(width: int, rounds: int) -> dict[str, tuple[int, ...]]:
    """The shape of every parameter of a network."""
    nodes, edges = len(NODE_FEATURES), len(EDGE_FEATURES)
    layers = {"embed": (width, nodes), "pool": (width, width)}
    for index in range(rounds):
        layers[f"receive.{index}"] = layers[f"update.{index}"] = (width, width)
        layers[f"hidden.{index}"] = (width, 2 * width)
    for head, inputs in (("grasp", 2 * width), ("place", 3 * width + edges)):
        layers |= {f"{head}.0": (width, inputs), f"{head}.2": (1, width)}
    parts: dict[str, tuple[int, ...]] = {f"{name}.weight": size for name, size in layers.items()}
    parts |= {f"{name}.bias": size[:1] for name, size in layers.items()}
    for index in range(rounds):
        parts[f"send.{index}.weight"], parts[f"edge.{index}.weight"] = (
            (width, width),
            (width, edges),
        )
    return parts


@dataclass(frozen=True)
class Model:
    """A trained relational network and what it was trained with."""

    weights: Weights
    training: Mapping[str, Any]
    """Settings and seeds that it was trained with."""

    def save(self, directory: Path) -> None:
        """Write ``relational.safetensors`` and ``relational.json``; same model, same bytes."""
        document = {
            "version": VERSION,
            "network": NAME,
            "width": self.weights.width,
            "rounds": self.weights.rounds,
            "nodes": list(NODE_FEATURES),
            "edges": list(EDGE_FEATURES),
            "limits": asdict(self.weights.limits),
            "training": self.training,
        }
        with written_whole(directory / f"{NAME}.safetensors") as unfinished:
            unfinished.write_bytes(save(dict(self.weights.tensors)))
        write_json(directory / f"{NAME}.json", document)


def load_weights(directory: Path) -> Weights:
    """Read the weights that :meth:`Model.save` wrote.

    Raises:
        InputError: a file is missing, damaged, of another version or for another encoding.
    """
    path = directory / f"{NAME}.json"
    document = read_json(path, _REMEDY)
    version = document.get("version") if isinstance(document, dict) else None
    if version != VERSION:
        raise InputError(f"{path}: version", f"is {version!r}", _REMEDY)
    if document.get("nodes") != list(NODE_FEATURES) or document.get("edges") != list(EDGE_FEATURES):
        raise InputError(f"{path}: nodes, edges", "are not what this program encodes", _REMEDY)
    try:
        limits = Range(**{name: tuple(map(float, v)) for name, v in document["limits"].items()})
        ordered = all(low < high for low, high in zip(limits.lower, limits.upper, strict=True))
    except (AttributeError, KeyError, TypeError, ValueError):
        ordered = False
    if not ordered or len(limits.lower) != 3:
        raise InputError(f"{path}: limits", "are not a range of x, y and z", _REMEDY)
    width, rounds = document.get("width"), document.get("rounds")
    if not all(type(value) is int and 1 <= value <= _LARGEST for value in (width, rounds)):
        raise InputError(f"{path}: width, rounds", f"are {width!r}, {rounds!r}", _REMEDY)
    path = directory / f"{NAME}.safetensors"
    try:
        tensors = load_file(path)
    except (OSError, SafetensorError) as error:
        fault = "is missing" if isinstance(error, FileNotFoundError) else "is damaged"
        raise InputError(str(path), fault, _REMEDY) from None
    expected = shapes(width, rounds)
    if {name: tensor.shape for name, tensor in tensors.items()} != expected:
        raise InputError(str(path), "does not have the weights that its JSON describes", _REMEDY)
    if not all(np.isfinite(tensor).all() for tensor in tensors.values()):
        raise InputError(str(path), "has weights that are not finite", _REMEDY)
    return Weights(limits, {name: tensor.astype(np.float32) for name, tensor in tensors.items()})
