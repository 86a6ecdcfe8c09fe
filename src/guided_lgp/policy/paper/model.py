"""The files of a trained network: safetensors for the weights, JSON for what they mean."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from guided_lgp.documents import read_json, write_json
from guided_lgp.errors import InputError
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.paper.encoding import VERSION, Encoding
from guided_lgp.policy.tensors import read_weights, write_tensors

Layers = tuple[tuple[FloatArray, FloatArray], ...]
"""Weight (outputs, inputs) and bias (outputs,) of every layer of a sub-policy."""


@dataclass(frozen=True)
class Model:
    """A trained network: its sub-policies in the order of the chain, and their encoding."""

    network: str
    encoding: Encoding
    sub_policies: Mapping[str, Layers]
    training: Mapping[str, Any]
    """Settings and seeds that it was trained with."""

    def save(self, directory: Path) -> None:
        """Write ``<network>.safetensors`` and ``<network>.json``; same model, same bytes."""
        tensors = {}
        for name, layers in self.sub_policies.items():
            for index, (weight, bias) in enumerate(layers):
                tensors[f"{name}.{index}.weight"] = weight
                tensors[f"{name}.{index}.bias"] = bias
        document = {
            "version": VERSION,
            "network": self.network,
            "sub_policies": {
                name: [layers[0][0].shape[1], *(len(bias) for _, bias in layers)]
                for name, layers in self.sub_policies.items()
            },
            "activation": "relu",
            "training": self.training,
            "encoding": self.encoding.document(),
        }
        write_tensors(directory / f"{self.network}.safetensors", tensors)
        write_json(directory / f"{self.network}.json", document)


def load_model(directory: Path, network: str, stage: str = "train_policy") -> Model:
    """Read what :meth:`Model.save` wrote.

    Args:
        directory: the folder of the files.
        network: ``instruction``, or the name of one.
        stage: the stage that makes them, for the message.

    Raises:
        InputError: a file is missing, damaged, of another version or for another encoding.
    """
    path = directory / f"{network}.json"
    remedy = f"version {VERSION}, the output of the stage {stage}"
    document = read_json(path, remedy)
    version = document.get("version") if isinstance(document, dict) else None
    if version != VERSION:
        raise InputError(f"{path}: version", f"is {version!r}", remedy)
    encoding = Encoding.parse(document.get("encoding"), str(path), stage)
    sizes = _sizes(document, network, encoding)
    if sizes is None:
        raise InputError(f"{path}: sub_policies", "do not fit the network's chain", remedy)
    path = directory / f"{network}.safetensors"
    tensors = read_weights(path, remedy)
    sub_policies = {}
    for name, widths in sizes.items():
        layers = []
        for index, shape in enumerate(zip(widths[1:], widths[:-1], strict=True)):
            weight = tensors.get(f"{name}.{index}.weight")
            bias = tensors.get(f"{name}.{index}.bias")
            if weight is None or bias is None or (weight.shape, bias.shape) != (shape, shape[:1]):
                fault = f"does not have the {shape[0]} × {shape[1]} weights that its JSON names"
                raise InputError(f"{path}: {name}.{index}", fault, remedy)
            layers.append((weight, bias))
        sub_policies[name] = tuple(layers)
    return Model(network, encoding, sub_policies, document["training"])


def _sizes(document: Any, network: str, encoding: Encoding) -> dict[str, list[int]] | None:
    """Layer sizes of each sub-policy, or None if they do not fit the chain."""
    described = document.get("sub_policies")
    if not isinstance(described, dict) or not isinstance(document.get("training"), dict):
        return None
    if network not in encoding.chains:
        return None
    sizes = {}
    for name in encoding.chains[network]:
        widths = described.get(name)
        if not isinstance(widths, list) or len(widths) < 2:
            return None
        if not all(type(width) is int and width > 0 for width in widths):
            return None
        sizes[name] = widths
    ends = [(widths[0], widths[-1]) for widths in sizes.values()]
    classes = [encoding.classes(name) for name in encoding.chains[network]]
    expected = list(zip(encoding.chain_inputs(network), classes, strict=True))
    return sizes if ends == expected and document.get("network") == network else None
