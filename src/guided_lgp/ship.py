"""Take the pipeline's trained weights and limits into the package (``make ship``)."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from guided_lgp.documents import write_text, written_whole
from guided_lgp.params import Params, PlanningParams, load_params
from guided_lgp.paths import METRICS, MODELS, PARAMS, PLANNING, TRAINED
from guided_lgp.policy.declaration import PolicyDeclaration
from guided_lgp.policy.registry import POLICIES, TRAINED_POLICIES
from guided_lgp.report.metrics import GENERALIZATION, Metrics, read_metrics
from guided_lgp.search.planners import TABLE_1

CARD = "README.md"
"""The model card, beside the weights."""
_HEADING = "# Limits of planning; written by `make ship` from params.yaml.\n"


def ship(root: Path, models: Path = MODELS, limits: Path = PLANNING) -> None:
    """Copy the weights of a clone, and the sections of its parameters that planning reads.

    Args:
        root: the folder of ``dvc.yaml``.
        models: the folder to fill, with a model card.
        limits: the file to write.

    Raises:
        InputError: the parameters or metrics are missing or damaged, or a file cannot be written.
    """
    params = load_params(root / PARAMS)
    figures = root / METRICS / "generalization.json"
    metrics = read_metrics(figures, "evaluate_generalization", GENERALIZATION)
    for name in _weights():  # cases have policies of their own beside these
        with written_whole(models / name) as unfinished:
            shutil.copyfile(root / TRAINED / name, unfinished)
    write_text(models / CARD, model_card(params, metrics))
    planning = params.model_dump(include=set(PlanningParams.model_fields))
    write_text(limits, _HEADING + yaml.safe_dump(planning, sort_keys=True))


def _weights() -> Iterator[Path]:
    """The files of all trained policies, in a folder of models."""
    for policy in TRAINED_POLICIES.values():
        for network in policy.networks:
            yield Path(policy.folder, f"{network}.json")
            yield Path(policy.folder, f"{network}.safetensors")


def model_card(params: Params, metrics: Metrics) -> str:
    """What the weights are for, what they were trained on, and how well they do, in Markdown.

    Args:
        params: of the pipeline that trained them.
        metrics: shares of solutions by planner and set of objectives.
    """
    scenes, objectives = params.generate_scenes, params.build_dataset
    policies = [
        f"| {name} | {', '.join(_file(declared, network) for network in declared.networks)} | "
        f"{declared.summary} |"
        for name, declared in TRAINED_POLICIES.items()
    ]
    rows = [
        f"| {POLICIES[planner.policy].label}, {planner.strategy} | "
        f"{_share(metrics[key], 'all')} | {_share(metrics[key], 'unseen')} |"
        for key, planner in TABLE_1.items()
        if key in metrics
    ]
    return _CARD.format(
        training=scenes.training_configurations,
        test=scenes.test_configurations,
        objectives=objectives.training_objectives,
        seeds=f"{scenes.seed_training}, {objectives.seed}, {params.train_policy.seed}",
        policies="\n".join(policies),
        rows="\n".join(rows),
    )


def _file(declared: PolicyDeclaration, network: str) -> str:
    """Where the weights of a network are, beside the card."""
    return f"`{Path(declared.folder) / network}`"


def _share(subsets: dict[str, Any], subset: str) -> str:
    return f"{100 * subsets[subset]['shortest']:.1f} %"


_CARD = """\
# Model card

Written by `make ship`. Small feed-forward and message-passing networks (safetensors, float32) that
score the next action of a pick-and-place task; guided-lgp reads them with NumPy. They propose;
whether an action is possible is decided by a nonlinear program and verified in simulation.

| policy | networks | what it is |
|---|---|---|
{policies}

**Input.** One or two goals `(on BOX TABLE)`, `(held BOX)`; what stands where; positions of
grippers, boxes and tables (m). **Output.** A log-probability per applicable action. Sizes of boxes
are not an input.

**Training.** Shortest feasible sequences of actions in {training} random scenes of three boxes on
two tables before a PR2, for {objectives} objectives of two goals. No data from people or robots.
Seeds (scenes, objectives, training): {seeds}.

**Evaluation.** {test} other scenes, all 87 objectives of one or two goals; share of problems solved
with the smallest number of actions:

| policy, search | all objectives | unseen ones |
|---|---:|---:|
{rows}

**Limits.** Trained with one robot, one size of box and tables of one height. Where geometry decides
the order of actions, the policy cannot see it. MIT licence, as the program.
"""


if __name__ == "__main__":
    ship(Path.cwd())
