"""Stage render_reports: tables, figures, pages and replays from what the other stages wrote."""

import logging
import shutil
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import write_json, write_text
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import BoundsParams, Params
from guided_lgp.paths import METRICS, REPORTS
from guided_lgp.policy.split import training_objectives
from guided_lgp.report import (
    analysis,
    case_figures,
    cases,
    figures,
    panels,
    scalability_figures,
    scalability_tables,
    tables,
)
from guided_lgp.report.contents import compose
from guided_lgp.report.drawing import save
from guided_lgp.report.inputs import Inputs, compared, load_inputs, sub_policies
from guided_lgp.report.panels import Drawing
from guided_lgp.report.summary import summary
from guided_lgp.report.table import Table
from guided_lgp.search.planners import GUIDED, RIVALS, TABLE_3
from guided_lgp.view.pictures import draw_scene
from guided_lgp.view.replay import replay_html

REPLAYED = ("a", "b", "c", "d", "e10")
"""Setups of which one plan is replayed; a page of about 1 MB each."""
_SHOWN = (*GUIDED, *RIVALS)
"""Whose plan is replayed, if it has one."""

logger = logging.getLogger(__name__)


def run(params: Params, root: Path) -> None:
    """Write the report with its tables, figures and replays, and two files of metrics.

    ``reports/metrics/training.json`` has what the networks' training says, ``summary.json`` the
    figures by which executions of the pipeline are compared.

    Args:
        params: limits and seeds, which the report names.
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: an output of an earlier stage is missing, and the message names the stage; or
            a file cannot be written.
    """
    inputs = load_inputs(root)
    reports = root / REPORTS
    for folder in ("curves", "tables", "figures", "replays"):
        shutil.rmtree(reports / folder, ignore_errors=True)
        (reports / folder).mkdir(parents=True)
    write_json(root / METRICS / "training.json", tables.training_metrics(inputs.training))
    write_json(root / METRICS / "summary.json", summary(inputs))
    _write_curves(inputs, reports / "curves")
    novelty = _novelty(inputs, params)
    calls = analysis.calls(inputs.problems)
    written = {table.name: table for table in _tables(inputs, novelty, calls)}
    for table in written.values():
        for suffix, text in (
            ("md", table.markdown()),
            ("tex", table.latex()),
            ("csv", table.csv()),
        ):
            write_text(reports / "tables" / f"{table.name}.{suffix}", text)
    drawings = _drawings(inputs, params)
    for name, drawing in drawings.items():
        save(drawing.figure, reports / "figures", name)
    for setup in inputs.setups:
        scene = inputs.scenes[f"scalability_{setup}"].scenes[0]
        draw_scene(scene, reports / "figures" / f"setup_{setup}.png")
    replays = _replays(inputs, params.bounds, reports)
    rest = {name: drawing.rest for name, drawing in drawings.items()}
    document = compose(inputs, params, novelty, written, rest, replays)
    write_text(reports / "report.md", document.markdown())
    write_text(reports / "report.html", document.html(reports))
    logger.info("report: %s", reports / "report.html")


def _novelty(inputs: Inputs, params: Params) -> Mapping[str, str]:
    """How new every objective of setup a is."""
    draw = params.build_dataset
    symbols = inputs.scenes["test"].scenes[0].symbols
    chosen = training_objectives(symbols, draw.training_objectives, draw.seed)
    return analysis.novelty(symbols, chosen)


def _tables(
    inputs: Inputs, novelty: Mapping[str, str], calls: Mapping[str, Mapping[str, float]]
) -> list[Table]:
    rejected = {name: (len(s.scenes), s.rejected) for name, s in inputs.scenes.items()}
    optional = [tables.geometry(inputs.geometry)] if inputs.geometry is not None else []
    optional += [tables.draws(inputs.spread)] if inputs.spread is not None else []
    optional += [cases.table(name, sizes) for name, sizes in (inputs.cases or {}).items()]
    optional += [cases.comparison(inputs.cases_compared)] if inputs.cases_compared else []
    return [
        tables.generalization(inputs.generalization, calls),
        tables.unseen(analysis.by_novelty(inputs.problems, novelty), novelty),
        *scalability_tables.scalability(inputs.scalability, inputs.timing),
        tables.training(inputs.training),
        tables.enumeration(analysis.by_length(inputs.verdicts), rejected),
        *optional,
    ]


def _write_curves(inputs: Inputs, folder: Path) -> None:
    """One CSV file per sub-policy, a row per epoch, which ``dvc plots`` draws."""
    for policy, name, report in sub_policies(inputs):
        file = "_".join((policy, *name.split(": "))) + ".csv"
        curves = pd.DataFrame(report["curves"])
        curves.insert(0, "epoch", range(1, len(curves) + 1))
        write_text(folder / file, curves.to_csv(index=False))


def _drawings(inputs: Inputs, params: Params) -> Mapping[str, Drawing]:
    limit = params.compare_scalability.max_tree_size
    failures = analysis.failures(inputs.verdicts, inputs.configurations)
    optional = {"cases": Drawing(case_figures.calls(inputs.cases))} if inputs.cases else {}
    return {
        "tree_size": Drawing(scalability_figures.tree_size(inputs.scalability, limit)),
        "time": Drawing(scalability_figures.time(inputs.scalability, inputs.timing)),
        "solved": Drawing(scalability_figures.solved(inputs.scalability)),
        "success": panels.success(inputs),
        "confusion": panels.confusion(inputs),
        "feasible_share": panels.feasible_share(inputs),
        "failures": Drawing(figures.failures(failures)),
        **optional,
    }


def _replays(inputs: Inputs, bounds: BoundsParams, reports: Path) -> list[tuple[str, str]]:
    """Write a replay of one plan per setup, by the first planner of :data:`_SHOWN` that has one.

    Returns:
        Address relative to the report and description of each.
    """
    written = []
    solved = inputs.runs[inputs.runs["solved"].astype(bool)]
    for setup in REPLAYED:
        names = [problem.name for problem in compared(inputs.scalability) if problem.setup == setup]
        if not names:
            continue
        scenes = {scene.name: scene for scene in inputs.scenes[f"scalability_{setup}"].scenes}
        plans = solved[solved["problem"].isin(names)].sort_values(
            "planner", key=lambda planners: planners.map(_SHOWN.index), kind="stable"
        )
        for plan in plans.itertuples():
            # The evaluation keeps sequences, not motions; a bound gives the same motion again.
            scene, actions = scenes[str(plan.configuration)], parse_skeleton(str(plan.skeleton))
            trajectory = SceneBounds(scene, bounds).path(actions).trajectory
            if trajectory is not None:
                address = f"replays/{setup}.html"
                objective = analysis.read_objective(str(plan.objective))
                replay_html(trajectory, scene, reports / address, actions, objective)
                planner = TABLE_3[str(plan.planner)].label
                text = f"{plan.objective}: {len(actions)} actions, {planner}"
                written.append((address, f"Problem {plan.problem}, {text}"))
                break
    return written
