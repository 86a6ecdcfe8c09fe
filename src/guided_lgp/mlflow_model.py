"""A trained network as MLflow loads it: ``mlflow.pyfunc.load_model(uri).predict(inputs)``.

MLflow keeps the weights and the name of this module; nothing is pickled.
"""

from pathlib import Path

import numpy as np

from guided_lgp.policy.encoding import FloatArray
from guided_lgp.policy.inference import chain_log_probabilities
from guided_lgp.policy.models import Model, load_model


class Network:
    """Probabilities of a network's decisions."""

    def __init__(self, model: Model) -> None:
        self._chain = tuple(model.sub_policies.values())
        self.inputs: int = self._chain[0][0][0].shape[1]
        self.outputs = int(np.prod([len(layers[-1][1]) for layers in self._chain]))

    def predict(self, inputs: FloatArray) -> FloatArray:
        """Evaluate the network.

        Args:
            inputs: (n, inputs) encoded objectives and states.

        Returns:
            (n, outputs) probability of every combination of the classes of the sub-policies, those
            of the last one varying fastest.
        """
        log_p = chain_log_probabilities(self._chain, np.asarray(inputs, dtype=np.float32))
        probabilities: FloatArray = np.exp(log_p).reshape(len(inputs), self.outputs)
        return probabilities


def _load_pyfunc(data_path: str) -> Network:
    """Called by MLflow with the folder that :func:`log_network` has logged."""
    (weights,) = Path(data_path).glob("*.safetensors")
    return Network(load_model(weights.parent, weights.stem))


def log_network(folder: Path, name: str) -> None:
    """Log a network to the active run, with its signature and an input example.

    Args:
        folder: with ``<name>.safetensors`` and ``<name>.json`` alone.
        name: ``instruction``, ``grasp`` or ``place``.
    """
    import mlflow
    from mlflow.models import ModelSignature
    from mlflow.types import Schema, TensorSpec

    network = Network(load_model(folder, name))
    real = np.dtype(np.float32)
    mlflow.pyfunc.log_model(
        name=name,
        loader_module=__name__,
        data_path=str(folder),
        signature=ModelSignature(
            inputs=Schema([TensorSpec(real, (-1, network.inputs))]),
            outputs=Schema([TensorSpec(real, (-1, network.outputs))]),
        ),
        input_example=np.zeros((2, network.inputs), np.float32),
        pip_requirements=["guided-lgp"],
    )
