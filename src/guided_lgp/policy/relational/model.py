"""The trained relational network: its files, and its scores without torch."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from guided_lgp.documents import read_json, write_json
from guided_lgp.domains import PAPER, load_domain
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.logic import Domain
from guided_lgp.policy.arrays import BoolArray, FloatArray
from guided_lgp.policy.relational.encoding import EDGE_FEATURES, NODE_FEATURES, Graphs, Range
from guided_lgp.policy.relational.geometry import BLIND, Sight
from guided_lgp.policy.relational.heads import Head, heads
from guided_lgp.policy.tensors import read_weights, write_tensors

VERSION = 1
NAME = "relational"
_REMEDY = f"version {VERSION}, the output of the stage train_relational"


@dataclass(frozen=True)
class Weights:
    """The parameters of a trained network, by their names in torch."""

    limits: Range
    """Of the positions in training."""
    tensors: Mapping[str, FloatArray]
    domain: Domain
    """Whose instructions have heads."""
    sight: Sight = BLIND
    """What it sees beside relations."""

    @property
    def width(self) -> int:
        """Length of a node's state."""
        return len(self.tensors["embed.bias"])

    @property
    def rounds(self) -> int:
        """Rounds of message passing."""
        return sum(name.startswith("send.") for name in self.tensors)

    def scores(self, graphs: Graphs) -> dict[str, FloatArray]:
        """Scores of all actions of one problem; the counterpart of the network in torch.

        Returns:
            For every instruction (G, T): of each table as its target, by each gripper. Those of a
            gripper that holds nothing mean nothing where the instruction needs something held.
        """
        state = _relu(self._linear("embed", graphs.nodes[0]))
        edges, held = graphs.edges[0], graphs.held[0]
        related = edges.any(axis=2)
        for index in range(self.rounds):
            sent = self._linear(f"send.{index}", state)
            along = self._linear(f"edge.{index}", edges[related])
            said = largest_messages(sent, related, along)
            heard = _relu(self._linear(f"receive.{index}", state) + said)
            hidden = self._linear(f"hidden.{index}", np.concatenate([state, heard], axis=-1))
            state = state + self._linear(f"update.{index}", _relu(hidden))
        whole = _relu(self._linear("pool", state)).max(axis=1, keepdims=True)
        in_hand = np.take_along_axis(state, held[:, None, None], axis=1)
        free = [state, np.broadcast_to(whole, state.shape)]
        full = [*free, np.broadcast_to(in_hand, state.shape), edges[held]]
        return {
            name: self._head(name, full if head.holds else free)
            for name, head in heads(self.domain).items()
        }

    def _head(self, name: str, parts: list[FloatArray]) -> FloatArray:
        hidden = _relu(self._linear(f"{name}.0", np.concatenate(parts, axis=-1)))
        return self._linear(f"{name}.2", hidden)[..., 0]

    def _linear(self, name: str, inputs: FloatArray) -> FloatArray:
        outputs: FloatArray = inputs @ self.tensors[f"{name}.weight"].T
        bias = self.tensors.get(f"{name}.bias")
        return outputs if bias is None else outputs + bias


def largest_messages(sent: FloatArray, related: BoolArray, along: FloatArray) -> FloatArray:
    """The largest message that every node gets, without looking at every pair of nodes.

    Args:
        sent: (G, T, W) what every node says to all.
        related: (T, T) whether a node (row) is related to another (column): few are, and no node to
            itself.
        along: (relations, W) what a relation adds, in the order of ``np.nonzero(related)``.

    Returns:
        (G, T, W).
    """
    said = _largest_unrelated(sent, related)
    rows, columns = np.nonzero(related)
    if len(rows):
        first = np.flatnonzero(np.diff(rows, prepend=-1))
        near = np.maximum.reduceat(sent[:, columns] + along, first, axis=1)
        said[:, rows[first]] = np.maximum(said[:, rows[first]], near)
    return said


def _largest_unrelated(sent: FloatArray, related: BoolArray) -> FloatArray:
    """(G, T, W) the largest of what is sent by nodes to which a node is not related.

    That is the largest of all, or else the next largest, and so on: to itself it is not related.
    """
    by_size = np.argsort(-sent, axis=1)
    chosen = np.repeat(by_size[:, :1], len(related), axis=1)
    node, gripper, part = np.nonzero(related[:, by_size[:, 0]])
    rank = 0
    while len(node):
        rank += 1
        sender = by_size[gripper, rank, part]
        chosen[gripper, node, part] = sender
        barred = related[node, sender]
        node, gripper, part = node[barred], gripper[barred], part[barred]
    return np.take_along_axis(sent, chosen, axis=1)


def _relu(values: FloatArray) -> FloatArray:
    return np.maximum(values, 0)


def shapes(
    width: int, rounds: int, heads: Mapping[str, Head], sight: Sight = BLIND
) -> dict[str, tuple[int, ...]]:
    """The shape of every parameter of a network."""
    nodes, edges = len(NODE_FEATURES + sight.nodes), len(EDGE_FEATURES + sight.edges)
    layers = {"embed": (width, nodes), "pool": (width, width)}
    for index in range(rounds):
        layers[f"receive.{index}"] = layers[f"update.{index}"] = (width, width)
        layers[f"hidden.{index}"] = (width, 2 * width)
    for name, head in heads.items():
        inputs = 3 * width + edges if head.holds else 2 * width
        layers |= {f"{name}.0": (width, inputs), f"{name}.2": (1, width)}
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
            **({} if self.weights.domain.name == PAPER else {"domain": self.weights.domain.name}),
            "width": self.weights.width,
            "rounds": self.weights.rounds,
            "nodes": list(NODE_FEATURES + self.weights.sight.nodes),
            "edges": list(EDGE_FEATURES + self.weights.sight.edges),
            "limits": asdict(self.weights.limits),
            "training": self.training,
        }
        write_tensors(directory / f"{NAME}.safetensors", self.weights.tensors)
        write_json(directory / f"{NAME}.json", document)


class _Limits(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    lower: Annotated[list[float], Field(min_length=3, max_length=3)]
    upper: Annotated[list[float], Field(min_length=3, max_length=3)]

    @model_validator(mode="after")
    def _ordered(self) -> "_Limits":
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise PydanticCustomError("range", "are not a range of x, y and z")
        return self


class _Document(BaseModel):
    """The JSON file of a network."""

    model_config = ConfigDict(strict=True, extra="forbid")

    version: Literal[1]
    network: Literal["relational"]
    domain: str = PAPER
    width: Annotated[int, Field(ge=1, le=1024)]
    rounds: Annotated[int, Field(ge=1, le=1024)]
    nodes: list[str]
    edges: list[str]
    limits: _Limits
    training: dict[str, Any]


def load_weights(directory: Path) -> Weights:
    """Read the weights that :meth:`Model.save` wrote.

    Raises:
        InputError: a file is missing, damaged, of another version or for another encoding.
    """
    path = directory / f"{NAME}.json"
    document = validated(_Document.model_validate, read_json(path, _REMEDY), str(path), _REMEDY)
    sight = _sight(document, path)
    limits = Range(tuple(document.limits.lower), tuple(document.limits.upper))
    domain = load_domain(document.domain)
    path = directory / f"{NAME}.safetensors"
    tensors = read_weights(path, _REMEDY)
    expected = shapes(document.width, document.rounds, heads(domain), sight)
    if {name: tensor.shape for name, tensor in tensors.items()} != expected:
        raise InputError(str(path), "does not have the weights that its JSON describes", _REMEDY)
    return Weights(limits, tensors, domain, sight)


def _sight(document: _Document, path: Path) -> Sight:
    """What the network sees beside the relations, which all see."""
    nodes, edges = len(NODE_FEATURES), len(EDGE_FEATURES)
    seen = document.nodes[:nodes], document.edges[:edges]
    sight = Sight(tuple(document.nodes[nodes:]), tuple(document.edges[edges:]))
    if not sight.known or seen != (list(NODE_FEATURES), list(EDGE_FEATURES)):
        raise InputError(f"{path}: nodes, edges", "are not what this program encodes", _REMEDY)
    return sight
