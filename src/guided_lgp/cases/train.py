"""The policies of a case: one per training and control, from its demonstrations."""

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from guided_lgp import parallel
from guided_lgp.cases.policies import (
    SHUFFLED,
    SIGHTS,
    demonstrations_of,
    models_of,
    trained_with,
)
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import Domain
from guided_lgp.params import Params, TrainRelational
from guided_lgp.policy.arrays import BoolArray
from guided_lgp.policy.relational.encoding import GOAL_HELD, Range, Situations, graphs
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.model import Model
from guided_lgp.policy.relational.samples import Examples, on_surfaces, preferred
from guided_lgp.policy.relational.training import fit
from guided_lgp.policy.tensors import Shape, read_arrays, require_range

_DEMONSTRATIONS: dict[str, tuple[type, Shape]] = {
    "positions": (np.float32, ("states", "nodes", 3)),
    "shapes": (np.float32, ("states", "nodes", 4)),
    "supports": (np.int8, ("states", "bodies")),
    "goals": (np.int8, ("states", "bodies")),
    "right": (np.bool_, ("states", "grippers", "nodes")),
    "wrong": (np.bool_, ("states", "grippers", "nodes")),
    "configuration": (np.int32, ("states",)),
}
"""What :mod:`~guided_lgp.cases.demonstrate` writes."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Training:
    """One network to train, and where it goes."""

    examples: Examples
    policy: str
    settings: TrainRelational
    folder: Path


def run(params: Params, root: Path, name: str, seed: int) -> None:
    """Write ``models/<case>/<seed>`` for the policy of the case and its controls."""
    case = params.cases[name]
    examples = load_demonstrations(root, name, load_domain(case.domain))
    settings = case.training.model_copy(update={"seed": seed})
    tasks = [
        Training(examples, policy, settings, models_of(root, name, policy, seed))
        for policy in trained_with(case, seed)
    ]
    parallel.run(train, tasks, params.parallel, f"{name}: training {seed}")


def load_demonstrations(root: Path, case: str, domain: Domain) -> Examples:
    """The labelled states of a case.

    Of several right actions, those are taught that do not put a box on another one, if there are
    such: with three boxes it does no harm, with seven that one may be in the way itself.

    Raises:
        InputError: the file is missing or damaged; the message names the stage.
    """
    remedy = f"the output of demonstrate --case {case}"
    path = demonstrations_of(root, case)
    arrays, sizes = read_arrays(path, _DEMONSTRATIONS, remedy)
    limits = {
        "supports": (-sizes["grippers"], sizes["nodes"]),
        "goals": (GOAL_HELD, sizes["nodes"]),
        "configuration": (0, np.inf),
    }
    require_range(path, arrays, limits, remedy)
    if sizes["bodies"] >= sizes["nodes"] or len(np.unique(arrays["configuration"])) < 2:
        raise InputError(str(path), "has no surface, or only one scene", remedy)
    if not arrays["right"].any(axis=(1, 2)).all():
        raise InputError(f"{path}: right", "has a state without a right action", remedy)
    situations = Situations(
        positions=arrays["positions"],
        supports=arrays["supports"].astype(np.int64),
        goals=arrays["goals"].astype(np.int64),
        grippers=sizes["grippers"],
        shapes=arrays["shapes"],
    )
    right = preferred(arrays["right"], on_surfaces(situations))
    return Examples(situations, right, arrays["configuration"], domain, arrays["wrong"])


def train(task: Training) -> None:
    """Train one network; whole scenes are held out, and decide when training stops."""
    examples = task.examples
    streams = np.random.SeedSequence(task.settings.seed).spawn(3)
    if task.policy == SHUFFLED:
        examples = shuffled(examples, np.random.default_rng(streams[0]))
    scenes = np.unique(examples.configuration)
    count = max(1, round(task.settings.validation_share * len(scenes)))
    chosen = np.random.default_rng(streams[1]).permutation(scenes)[:count]
    held_out = np.isin(examples.configuration, chosen)
    sight = SIGHTS[task.policy]
    result = fit(examples[~held_out], examples[held_out], task.settings, streams[2], sight)
    logger.info("%s: %s", task.folder, result)
    settings = {"samples": len(examples), **task.settings.model_dump()}
    Model(result.weights, settings).save(task.folder)


def shuffled(examples: Examples, rng: np.random.Generator) -> Examples:
    """One applicable action at random is right in every state, and none is known to be wrong."""
    inputs = graphs(examples.situations, Range.of(examples.situations))
    every = [
        head.applicable(examples.situations, inputs) for head in heads(examples.domain).values()
    ]
    allowed: BoolArray = np.logical_or.reduce(every)
    noise = np.where(allowed, rng.random(allowed.shape), -1).reshape(len(allowed), -1)
    right = np.zeros_like(noise, dtype=bool)
    right[np.arange(len(right)), noise.argmax(axis=1)] = True
    return replace(examples, right=right.reshape(allowed.shape), wrong=None)
