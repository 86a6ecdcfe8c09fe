"""The files of a trained network: safetensors for the weights, JSON for what they mean."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from guided_lgp.documents import read_json, write_json
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.paper.documents import NetworkDocument
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
    validate = NetworkDocument.model_validate
    document = validated(validate, read_json(path, remedy), str(path), remedy)
    encoding = Encoding.parse(document.encoding, str(path), stage)
    if document.network != network or not _fit(document.sub_policies, network, encoding):
        raise InputError(f"{path}: sub_policies", "do not fit the network's chain", remedy)
    path = directory / f"{network}.safetensors"
    tensors = read_weights(path, remedy)
    sub_policies = {}
    for name in encoding.chains[network]:
        widths = document.sub_policies[name]
        layers = []
        for index, shape in enumerate(zip(widths[1:], widths[:-1], strict=True)):
            weight = tensors.get(f"{name}.{index}.weight")
            bias = tensors.get(f"{name}.{index}.bias")
            if weight is None or bias is None or (weight.shape, bias.shape) != (shape, shape[:1]):
                fault = f"does not have the {shape[0]} × {shape[1]} weights that its JSON names"
                raise InputError(f"{path}: {name}.{index}", fault, remedy)
            layers.append((weight, bias))
        sub_policies[name] = tuple(layers)
    return Model(network, encoding, sub_policies, document.training)


def _fit(widths: Mapping[str, list[int]], network: str, encoding: Encoding) -> bool:
    """Whether the sub-policies are those of the network's chain, with their inputs and classes."""
    chain = encoding.chains.get(network, ())
    if widths.keys() != set(chain):
        return False
    ends = [(widths[name][0], widths[name][-1]) for name in chain]
    classes = map(encoding.classes, chain)
    return ends == list(zip(encoding.chain_inputs(network), classes, strict=True))
