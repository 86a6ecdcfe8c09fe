"""A trained policy as MLflow loads it: ``mlflow.pyfunc.load_model(uri).predict(inputs)``.

MLflow keeps the weights and the name of this module; nothing is pickled.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.documents import parse_json
from guided_lgp.logic import applicable_actions, parse_objective
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.declaration import DeclaredPolicy
from guided_lgp.policy.paper.inference import chain_log_probabilities
from guided_lgp.policy.paper.model import Model, load_model
from guided_lgp.policy.registry import POLICIES
from guided_lgp.scene import Box, Scene, Table, parse_scene
from guided_lgp.search.observation import observe, start

_SCENE = Scene(
    name="example",
    tables=(Table(name="tab1", position=(0.54, 0.33, 0.60), half_extents=(0.17, 0.20)),),
    boxes=(
        Box(name="red", size=(0.15, 0.07, 0.10), position=(0.48, 0.22, 0.65), on="tab1"),
        Box(name="green", size=(0.15, 0.07, 0.10), position=(0.56, 0.42, 0.65), on="tab1"),
    ),
)


class Network:
    """Probabilities of the decisions of one network of the hierarchical policy."""

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


class FirstActions:
    """Probabilities of the first actions in a scene, by a policy."""

    def __init__(self, policy: DeclaredPolicy) -> None:
        self._policy = policy

    def predict(self, inputs: Mapping[str, Any]) -> list[str]:
        """Evaluate the policy.

        Args:
            inputs: a data frame of n rows: ``scene``, the JSON document of a scene, and ``goals``,
                such as ``(on red green) (held blue)``.

        Returns:
            n JSON documents: the probability of every applicable action.

        Raises:
            InputError: a scene or a goal that cannot be read.
        """
        return [
            json.dumps(self._first_actions(parse_scene(parse_json(scene, "scene"), "scene"), goals))
            for scene, goals in zip(inputs["scene"], inputs["goals"], strict=True)
        ]

    def _first_actions(self, scene: Scene, goals: str) -> dict[str, float]:
        objective = parse_objective([f"{goal.strip()})" for goal in goals.split(")") if goal])
        for goal in objective:
            scene.symbols.domain.goal_type(goal)
        actions = list(applicable_actions(scene.state, scene.symbols))
        positions = observe(scene, start(scene))
        log_p = self._policy.log_probabilities(
            objective, scene.state, scene.symbols, positions, actions
        )
        pairs = zip(actions, np.exp(log_p).tolist(), strict=True)
        return {str(action): probability for action, probability in pairs}


def _load_pyfunc(data_path: str) -> Network | FirstActions:
    """Called by MLflow with the folder that :func:`log_model` has logged."""
    (weights,) = Path(data_path).glob("*.safetensors")
    for declared in POLICIES.values():
        if declared.networks == (weights.stem,):
            return FirstActions(declared.read(weights.parent))
    return Network(load_model(weights.parent, weights.stem))


def log_model(folder: Path, name: str) -> Any:
    """Log a trained model to the active run, with its signature and an input example.

    Args:
        folder: with ``<name>.safetensors`` and ``<name>.json`` alone.
        name: of a network that a policy declares; a policy of a single network is logged whole.

    Returns:
        MLflow's ``ModelInfo``.
    """
    import mlflow
    import pandas as pd
    from mlflow.models import ModelSignature
    from mlflow.types import ColSpec, Schema, TensorSpec

    loaded = _load_pyfunc(str(folder))
    example: Any
    if isinstance(loaded, Network):
        real = np.dtype(np.float32)
        example = np.zeros((2, loaded.inputs), real)
        inputs = Schema([TensorSpec(real, (-1, loaded.inputs))])
        outputs = Schema([TensorSpec(real, (-1, loaded.outputs))])
    else:
        row = {"scene": _SCENE.model_dump_json(), "goals": "(on red green)"}
        example = pd.DataFrame([row])
        inputs = Schema([ColSpec("string", column) for column in row])
        outputs = Schema([ColSpec("string")])
    return mlflow.pyfunc.log_model(
        name=name,
        loader_module=__name__,
        data_path=str(folder),
        signature=ModelSignature(inputs, outputs),
        input_example=example,
        pip_requirements=["guided-lgp"],
    )
