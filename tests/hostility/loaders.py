"""Every reader of a file, with good files to spoil."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

from guided_lgp import sources, tracking
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.plan_file import read_plan
from guided_lgp.bounds.verify import verify_path
from guided_lgp.cases import collect
from guided_lgp.cases.outcomes import outcomes_of
from guided_lgp.cases.policies import demonstrations_of
from guided_lgp.cases.replay import longest_plan
from guided_lgp.cases.shards import read_kept
from guided_lgp.cases.train import load_demonstrations, shuffled
from guided_lgp.clearance import clearance_of
from guided_lgp.documents import read_json, read_yaml
from guided_lgp.domains import load_domain
from guided_lgp.export import export_plan
from guided_lgp.logic import (
    parse_objective,
    parse_skeleton,
    two_goal_objectives,
)
from guided_lgp.logic.objectives import check_objective
from guided_lgp.mlflow_model import FirstActions
from guided_lgp.observed import observed_scene, read_observed
from guided_lgp.params import Params, load_planning, read_params
from guided_lgp.paths import (
    EVALUATION,
    METRICS,
    MODELS,
    REPORTS,
    SCENES,
    SEQUENCES,
    TRAINING,
)
from guided_lgp.policy.paper.dataset import load_dataset
from guided_lgp.policy.registry import DEFAULT_POLICY, load_policy
from guided_lgp.replanning import Course
from guided_lgp.report import analysis, metrics, tables
from guided_lgp.report.inputs import load_inputs
from guided_lgp.report.scalability_tables import scalability
from guided_lgp.report.summary import summary
from guided_lgp.robots.build import read_robot
from guided_lgp.scene import load_scene, load_scenes
from guided_lgp.scene.goals import complete_objective
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import world_of
from guided_lgp.search.given import read_skeleton
from guided_lgp.sequences import feasible_sequences, read_shortest
from guided_lgp.ship import model_card
from guided_lgp.studies.cases import RESULTS, load_study
from guided_lgp.studies.feasibility_tables import feasibility_tables
from guided_lgp.studies.tables import read_figures
from guided_lgp.tracking.metrics import read_metrics
from guided_lgp.tracking.stage_files import read_lock
from guided_lgp.view.replay import replay_html
from hostility import spoiling
from hostility.examples import (
    CASE,
    GOALS,
    PARAMS,
    ROOT,
    STUDY,
    Examples,
    built,
    in_database,
    write_shard_in,
)
from hostility.spoiling import Spoiler


@dataclass(frozen=True)
class Loader:
    """A reader, and the good files of which each input spoils one."""

    name: str
    folder: Path
    files: tuple[str, ...]
    read: Callable[[Path], object]
    """Is given the folder."""
    share: float = 1.0
    """How many inputs it gets, against others: slow readers get fewer."""

    def attempt(self, seed: int, number: int) -> object:
        """Spoil a file, read, and put the good file back."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, number]))
        file = self.folder / spoiling.pick(rng, self.files)
        good = file.read_bytes()
        file.write_bytes(spoiler(file)(good, rng))
        try:
            return self.read(self.folder)
        finally:
            file.write_bytes(good)


def spoiler(file: Path) -> Spoiler:
    """How a file is spoilt, by its suffix."""
    kinds = {
        ".json": spoiling.json_file,
        ".yaml": spoiling.yaml_file,
        ".lock": spoiling.yaml_file,
        ".safetensors": spoiling.tensor_file,
        ".parquet": spoiling.table_file,
        ".urdf": spoiling.xml_file,
        ".srdf": spoiling.xml_file,
        ".txt": spoiling.words,
        ".obj": spoiling.text,
        ".stl": spoiling.text,
        ".db": spoiling.text,
    }
    return kinds[file.suffix]


def loaders(folder: Path) -> tuple[Loader, ...]:
    """All of them, with good files below a folder."""
    examples = Examples(folder)
    return (
        *_documents(examples),
        *_arrays(examples),
        *_stage_files(examples),
        *_case_files(examples),
    )


def _documents(examples: Examples) -> Iterator[Loader]:
    scenes = tuple(file.name for file in sorted(examples.scenes.glob("*.json")))
    scenes = tuple(name for name in scenes if name not in ("plan.json", "surface.json"))
    for name in scenes:
        read = partial(_validated_scene, name=name)
        yield Loader(f"scene {name}", examples.scenes, (name,), read, 2 / len(scenes))
    yield Loader("plan", examples.scenes, ("plan.json",), lambda f: read_plan(f / "plan.json"), 0.3)
    yield Loader("plan in use", examples.scenes, ("plan.json",), _used, 0.1)
    given = ("text.txt", "pddl.txt", "plan.json")
    yield Loader("given actions", examples.skeletons, given, _given, 0.5)
    folder, state = examples.scenes / "observed", ("state.json",)
    yield Loader("observed state", folder, state, _observed, 0.5)
    for mesh, name in {"wedge.obj": "whole.json", "wedge.stl": "surface.json"}.items():
        read = partial(_validated_scene, name=name)
        yield Loader(f"mesh {mesh}", examples.scenes, (mesh,), read, 0.3)
    goals = tuple(f"goal{number}.txt" for number in range(len(GOALS)))
    yield Loader("goal", examples.scenes, goals, partial(_objective, names=goals))
    yield Loader("JSON", examples.scenes, scenes[:1], lambda f: read_json(f / scenes[0]))
    folder = examples.parameters
    yield Loader("YAML", folder, ("planning.yaml",), lambda f: read_yaml(f / "planning.yaml"))
    yield Loader(
        "parameters",
        folder,
        ("params.yaml",),
        lambda f: read_params(f / "params.yaml", Params),
        0.4,
    )
    yield Loader("limits", folder, ("planning.yaml",), lambda f: load_planning(f / "planning.yaml"))
    yield Loader("studies", folder, ("params.yaml", "studies/params.yaml"), load_study, 0.5)
    robot = (
        "own.yaml",
        *(f"own_description/{name}" for name in ("own.urdf", "own.srdf", "palm.obj")),
    )
    yield Loader("robot file", examples.robot, robot[:1], lambda f: read_robot(f / "own.yaml"), 0.5)
    yield Loader(
        "description", examples.robot, robot[1:], lambda f: read_robot(f / "own.yaml"), 0.15
    )


def _validated_scene(folder: Path, name: str) -> object:
    scene = load_scene(folder / name)
    validate_scene(scene, str(folder / name))
    return scene


def _used(folder: Path) -> object:
    """What is done with a plan: it is verified, looked at, and exported."""
    found = read_plan(folder / "plan.json")
    trajectory, symbols = found.trajectory, found.scene.symbols
    goals = GoalTerms.of(found.goals, symbols.domain)
    with TemporaryDirectory() as out:
        for name in ("motion.csv", "motion.json", "bag"):
            export_plan(found, Path(out, name))
        replay_html(trajectory, found.scene, Path(out, "page.html"), found.skeleton, found.goals)
    if verify_path(world_of(found.scene), found.skeleton, trajectory, goals).violation is None:
        clearance_of(found.scene, found.skeleton, trajectory)
    return Course.of(found)


def _given(folder: Path) -> object:
    """The one of the files that is not the good one."""
    scene = load_scene(folder / "three_boxes.json")
    for file in (folder / "pddl.txt", folder / "plan.json"):
        read_skeleton(str(file), scene.symbols, scene.state)
    text = (folder / "text.txt").read_bytes().decode("utf-8", "surrogateescape")
    return read_skeleton(text, scene.symbols, scene.state)


def _observed(folder: Path) -> object:
    scene = load_scene(folder.parent / "three_boxes.json")
    file = folder / "state.json"
    seen = observed_scene(scene, read_observed(file), str(file))
    validate_scene(seen, str(file))
    return seen


def _objective(folder: Path, names: tuple[str, ...]) -> object:
    scene = load_scene(folder / "three_boxes.json")
    texts = [(folder / name).read_bytes().decode("utf-8", "surrogateescape") for name in names]
    pairs = zip(texts, GOALS, strict=True)
    spoilt = next((text for text, goal in pairs if text != goal), GOALS[0])
    goals = complete_objective(parse_objective([spoilt]), scene)
    check_objective(goals, scene.symbols)
    return parse_skeleton(spoilt)


def _arrays(examples: Examples) -> Iterator[Loader]:
    for policy in ("paper", "improved", "relational"):
        prefix = "improved/" if policy == "improved" else ""
        names = ("relational",) if policy == "relational" else ("instruction", "grasp", "place")
        files = tuple(f"{prefix}{name}.{end}" for name in names for end in ("json", "safetensors"))
        yield Loader(f"policy {policy}", examples.models, files, partial(load_policy, policy))


def _stage_files(examples: Examples) -> Iterator[Loader]:
    folder = examples.outputs
    test = SCENES / "test.json"
    yield Loader("scenes", folder, (str(test),), lambda f: load_scenes(f / test))
    folder = examples.sequences
    tables = ("verdicts.parquet", "shortest.parquet")
    yield Loader("sequences", folder, tables, _sequences)
    yield Loader("samples of sequences", folder, tables, built, 0.5)
    files = ("dataset/dataset.json", "dataset/samples.safetensors")
    yield Loader("data set", folder, files, lambda f: load_dataset(f / "dataset"))
    yield Loader("data set, digest right", folder, files[1:], _with_its_digest)
    yield Loader("curves", examples.outputs, (str(TRAINING / "place.json"),), _curves)
    folder = examples.outputs
    files = tuple(
        sorted(
            str(file.relative_to(folder))
            for part in (METRICS, EVALUATION, SEQUENCES, TRAINING)
            for file in (folder / part).rglob("*")
            if file.is_file()
        )
    )
    yield Loader("report", folder, files, _report, 0.2)
    studies = tuple(str(RESULTS / f"{name}.json") for name in STUDY)
    yield Loader("tables of studies", examples.studies, studies, _study_tables, 0.5)
    shipped = (str(METRICS / "generalization.json"),)
    yield Loader("model card", folder, shipped, _card, 0.3)
    lock, stages = ("dvc.lock",), ("dvc.yaml",)
    yield Loader("dvc.lock", examples.parameters, lock, lambda f: read_lock(f / "dvc.lock"), 0.1)
    yield Loader("dvc.yaml", examples.parameters, stages, _sources, 0.1)
    shard = write_shard_in(examples.shard)
    parts = tuple(file.name for file in sorted(shard.iterdir()))
    yield Loader("shard", shard, parts, _made_again, 0.2)
    yield Loader("runs", examples.tracked, ("mlflow.db",), _runs, 0.02)
    yield Loader("input of MLflow", examples.scenes, ("three_boxes.json",), _first_actions, 0.3)


def _case_files(examples: Examples) -> Iterator[Loader]:
    folder = examples.case
    demonstrations = demonstrations_of(Path(), CASE)
    yield Loader("demonstrations", folder, (str(demonstrations),), _labels)
    reports = REPORTS / CASE
    rows = tuple(
        str(file.relative_to(folder)) for file in sorted((folder / reports).rglob("*.json"))
    )
    yield Loader("rows of a case", folder, rows, _collected)
    first = outcomes_of(Path(), CASE, PARAMS.cases[CASE].seeds[0])
    longest = partial(longest_plan, PARAMS, name=CASE)
    yield Loader("plan of a case", folder, (str(first),), lambda f: longest(root=f), 0.1)
    yield Loader("kept result", folder, ("kept.json",), lambda f: read_kept(f / "kept.json"), 0.3)


def _labels(folder: Path) -> object:
    found = load_demonstrations(folder, CASE, load_domain(PARAMS.cases[CASE].domain))
    return shuffled(found, np.random.default_rng(0))


def _collected(folder: Path) -> object:
    rows = collect.read_rows(folder, CASE, PARAMS.cases[CASE])
    figures = [collect.by_cell({CASE: rows}, part) for part in (collect.figures, collect.times)]
    return json.dumps([*figures, collect.compared(rows)], allow_nan=False)


def _study_tables(folder: Path) -> object:
    study, _ = load_study(ROOT)
    names = [(name, content) for name, content in study.tables.items() if name in STUDY]
    return [read_figures(folder, *one) for one in names], feasibility_tables(folder)


def _sequences(folder: Path) -> object:
    scenes = load_scenes(folder / "scenes.json").scenes
    objectives = two_goal_objectives(scenes[0].symbols)[:5]
    read_shortest(folder / "shortest.parquet", scenes, objectives)
    return feasible_sequences(folder / "verdicts.parquet", scenes)


def _made_again(shard: Path) -> object:
    """A damaged shard is computed again, to the same bytes."""
    write_shard_in(shard.parent)
    lines = (shard / "digests.txt").read_text().splitlines()
    for digest, part in map(str.split, lines):
        assert sha256((shard / f"{part}.parquet").read_bytes()).hexdigest() == digest
    return len(lines)


def _runs(folder: Path) -> object:
    """Recording never fails; what shows the runs says what is wrong."""
    with in_database(folder):
        with tracking.recorded("generate_scenes", PARAMS):
            pass
        with tracking.named_errors():
            return tracking.prepare()


def _first_actions(folder: Path) -> object:
    policy = FirstActions(load_policy(DEFAULT_POLICY, MODELS))
    scene = (folder / "three_boxes.json").read_bytes().decode("utf-8", "replace")
    return policy.predict({"scene": [scene], "goals": ["(on red green)"]})


def _sources(folder: Path) -> object:
    with patch.object(sources, "SOURCES", folder):
        return sources.source_digest(Path("dvc.yaml"), "enumerate_sequences")


def _card(folder: Path) -> object:
    file = folder / METRICS / "generalization.json"
    figures = metrics.read_metrics(file, "evaluate_generalization", metrics.GENERALIZATION)
    return model_card(PARAMS, figures)


def _with_its_digest(folder: Path) -> object:
    """Read samples whose digest in the description is the one of the spoilt file."""
    file = folder / "dataset" / "dataset.json"
    good = file.read_text()
    digest = sha256((folder / "dataset" / "samples.safetensors").read_bytes()).hexdigest()
    file.write_text(json.dumps(json.loads(good) | {"digest": digest}))
    try:
        return load_dataset(folder / "dataset")
    finally:
        file.write_text(good)


def _curves(folder: Path) -> object:
    return read_metrics(folder / TRAINING / "place.json")


def _report(folder: Path) -> object:
    inputs = load_inputs(folder)
    novelty = dict.fromkeys(inputs.problems["objective"], "new")
    return (
        summary(inputs),
        tables.training_metrics(inputs.training),
        tables.generalization(inputs.generalization, analysis.calls(inputs.problems)),
        tables.unseen(analysis.by_novelty(inputs.problems, novelty), novelty),
        scalability(inputs.scalability, inputs.timing),
        tables.training(inputs.training),
        analysis.by_length(inputs.verdicts),
        analysis.failures(inputs.verdicts, inputs.configurations),
    )
