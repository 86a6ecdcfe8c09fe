"""Stage render_reports: tables, figures, pages and replays from what the other stages wrote."""

import logging
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from guided_lgp.documents import write_json
from guided_lgp.logic import parse_skeleton
from guided_lgp.nlp.bounds import SceneBounds
from guided_lgp.params import BoundsParams, Params
from guided_lgp.paths import METRICS, REPORTS
from guided_lgp.report import analysis, figures, tables
from guided_lgp.report.contents import compose
from guided_lgp.report.inputs import Inputs, Metrics, load_inputs
from guided_lgp.report.pictures import draw_scene
from guided_lgp.report.replay import replay_html
from guided_lgp.report.style import NETWORKS, PLANNERS
from guided_lgp.report.table import Table

SETUPS = "abcd"

logger = logging.getLogger(__name__)


def run(params: Params, root: Path) -> None:
    """Write ``reports/metrics/training.json`` and the report with its tables, figures and replays.

    Args:
        params: limits and seeds, which the report names.
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: an output of an earlier stage is missing; the message names the stage.
    """
    inputs = load_inputs(root)
    reports = root / REPORTS
    for folder in ("tables", "figures", "replays"):
        shutil.rmtree(reports / folder, ignore_errors=True)
        (reports / folder).mkdir(parents=True)
    training = tables.training_metrics(inputs.training)
    write_json(root / METRICS / "training.json", training)
    written = {table.name: table for table in _tables(inputs, training)}
    for table in written.values():
        for suffix, text in (
            ("md", table.markdown()),
            ("tex", table.latex()),
            ("csv", table.csv()),
        ):
            (reports / "tables" / f"{table.name}.{suffix}").write_text(text, encoding="utf-8")
    for name, figure in _figures(inputs, params).items():
        figures.save(figure, reports / "figures", name)
    scenes = {setup: inputs.scenes[f"scalability_{setup}"].scenes[0] for setup in SETUPS}
    for setup, scene in scenes.items():
        draw_scene(scene, reports / "figures" / f"setup_{setup}.png")
    replays = _replays(inputs, params.bounds, reports)
    document = compose(inputs, params, written, SETUPS, replays)
    (reports / "report.md").write_text(document.markdown(), encoding="utf-8")
    (reports / "report.html").write_text(document.html(reports), encoding="utf-8")
    logger.info("report: %s", reports / "report.html")


def _tables(inputs: Inputs, training: Metrics) -> list[Table]:
    rejected = {name: (len(s.scenes), s.rejected) for name, s in inputs.scenes.items()}
    optional = [tables.geometry(inputs.geometry)] if inputs.geometry is not None else []
    return [
        tables.generalization(inputs.generalization),
        *tables.scalability(inputs.scalability, inputs.timing),
        tables.training(training),
        tables.enumeration(analysis.by_length(inputs.verdicts), rejected),
        *optional,
    ]


def _figures(inputs: Inputs, params: Params) -> Mapping[str, Figure]:
    scenes = {
        scene.name: scene for name in ("training", "test") for scene in inputs.scenes[name].scenes
    }
    sub_policies = {
        network if network == name else f"{network}: {name}": figures
        for network in NETWORKS
        for name, figures in inputs.training[network]["sub_policies"].items()
    }
    return {
        "success": figures.success(analysis.outcomes(inputs.problems, scenes)),
        "scalability": figures.scalability(
            inputs.scalability, inputs.timing, params.compare_scalability.max_tree_size
        ),
        "learning_curves": figures.learning_curves(
            {name: report["curves"] for name, report in sub_policies.items()}
        ),
        "confusion": figures.confusion(
            {
                name: (report["classes"], np.array(report["confusion"]))
                for name, report in sub_policies.items()
            }
        ),
        "feasible_share": figures.feasible_share(analysis.by_last_action(inputs.verdicts, scenes)),
        "failures": figures.failures(analysis.failures(inputs.verdicts, scenes)),
    }


def _replays(inputs: Inputs, bounds: BoundsParams, reports: Path) -> list[tuple[str, str]]:
    """Write a replay of one plan per setup: guided search's last, or else another planner's.

    Returns:
        Address relative to the report and description of each.
    """
    written = []
    solved = inputs.runs[inputs.runs["solved"].astype(bool)]
    solved = solved.sort_values("planner", key=lambda names: names == "guided", kind="stable")
    for setup in SETUPS:
        plans = solved[solved["problem"].str.startswith(setup)]
        if plans.empty:
            continue
        problem, configuration, objective, planner, skeleton = plans.iloc[-1][
            ["problem", "configuration", "objective", "planner", "skeleton"]
        ]
        scenes = inputs.scenes[f"scalability_{setup}"].scenes
        scene = next(scene for scene in scenes if scene.name == configuration)
        # The evaluation keeps sequences, not motions; a bound gives the same motion again.
        actions = parse_skeleton(skeleton)
        trajectory = SceneBounds(scene, bounds).path(actions).trajectory
        if trajectory is not None:
            address = f"replays/{setup}.html"
            replay_html(trajectory, scene, reports / address)
            plan = f"{len(actions)} actions by {PLANNERS[planner]}"
            written.append((address, f"Problem {problem}: {objective}, {plan}"))
    return written
