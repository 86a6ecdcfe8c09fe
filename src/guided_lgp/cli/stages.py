"""The stages of the pipeline, one command each."""

import os
import signal
import sys
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from guided_lgp.cli.alone import alone
from guided_lgp.cli.running import within
from guided_lgp.cli.terminal import ParamsFile, TimeLimit
from guided_lgp.paths import PARAMS

app = typer.Typer()

STAGES = {
    "generate_scenes": "guided_lgp.experiments.generate_scenes",
    "enumerate_sequences": "guided_lgp.experiments.enumerate_sequences",
    "build_dataset": "guided_lgp.experiments.build_dataset",
    "train_policy": "guided_lgp.experiments.train_policy",
    "train_improved": "guided_lgp.experiments.train_improved",
    "train_relational": "guided_lgp.experiments.train_relational",
    "evaluate_generalization": "guided_lgp.experiments.evaluate_generalization",
    "compare_scalability": "guided_lgp.experiments.compare_scalability",
    "render_reports": "guided_lgp.report.render",
}
"""The module of each stage of dvc.yaml; its ``run(params, root)`` does the work."""


class Network(str, Enum):
    """The networks of the hierarchical policy."""

    INSTRUCTION = "instruction"
    GRASP = "grasp"
    PLACE = "place"


NetworkName = Annotated[Network, typer.Argument(help="Which of the three networks to train.")]


@app.command("generate_scenes")
def generate_scenes(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Draw the scenes for training, test and scalability. Writes data/scenes.

    Example: guided-lgp generate_scenes
    """
    _run_stage("generate_scenes", params, timeout)


@app.command("enumerate_sequences")
def enumerate_sequences(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Find every shortest feasible sequence of actions in every scene. Writes data/sequences.

    Example: guided-lgp enumerate_sequences
    """
    _run_stage("enumerate_sequences", params, timeout)


@app.command("build_dataset")
def build_dataset(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Turn the sequences into samples for training. Writes data/dataset.

    Example: guided-lgp build_dataset
    """
    _run_stage("build_dataset", params, timeout)


@app.command("train_policy")
def train_policy(
    network: NetworkName,
    params: ParamsFile = PARAMS,
    timeout: TimeLimit = None,
) -> None:
    """Train one network of the paper's policy. Writes models, reports/training.

    Example: guided-lgp train_policy place
    """
    _run_stage("train_policy", params, timeout, network.value)


@app.command("train_improved")
def train_improved(
    network: NetworkName,
    params: ParamsFile = PARAMS,
    timeout: TimeLimit = None,
) -> None:
    """Train one network of the improved policy. Writes models/improved, reports/training/improved.

    Example: guided-lgp train_improved place
    """
    _run_stage("train_improved", params, timeout, network.value)


@app.command("train_relational")
def train_relational(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Train the relational policy. Writes models, reports/training.

    Example: guided-lgp train_relational
    """
    _run_stage("train_relational", params, timeout)


@app.command("evaluate_generalization")
def evaluate_generalization(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Plan every objective in every test scene (Table I). Writes reports/metrics.

    Example: guided-lgp evaluate_generalization
    """
    _run_stage("evaluate_generalization", params, timeout)


@app.command("compare_scalability")
def compare_scalability(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Compare the planners on problems of growing length (Table III). Writes reports/metrics.

    Example: guided-lgp compare_scalability
    """
    _run_stage("compare_scalability", params, timeout)


@app.command("render_reports")
def render_reports(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Draw the tables, figures and replays. Writes reports/report.html, reports/report.md.

    Example: guided-lgp render_reports
    """
    _run_stage("render_reports", params, timeout)


def _run_stage(stage: str, params_file: Path, timeout: float | None, *arguments: str) -> None:
    """Check all parameters, then run a stage, once at a time in a clone, and record it."""
    from guided_lgp import tracking
    from guided_lgp.params import load_params

    end_with_dvc()
    params = load_params(params_file)
    module = import_module(STAGES[stage])
    address = "@".join([stage, *arguments])
    root = Path.cwd()
    with within(timeout, address), alone(root, address), tracking.recorded(address, params):
        module.run(params, root, *arguments)


def end_with_dvc() -> None:
    """Have this process end when the DVC that started it, if one did, is gone.

    It ends as on SIGTERM: its workers with it, and the end is recorded.
    """
    from guided_lgp import parallel

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if "DVC_STAGE" in os.environ:
        parallel.end_with_parent(os.getppid(), signal.SIGTERM)
