"""Good files of every kind, to spoil."""

import json
import os
import shutil
from contextlib import AbstractContextManager
from functools import cached_property
from pathlib import Path
from unittest.mock import patch

import numpy as np
import yaml
from outputs import write_outputs
from own_robot import describe, document, written

from enumerated import write_enumeration
from guided_lgp import tracking
from guided_lgp.bounds.plan_file import read_plan, write_plan
from guided_lgp.cases.outcomes import outcomes_of, times_of
from guided_lgp.cases.policies import RIVALS, demonstrations_of
from guided_lgp.cases.shards import write_kept
from guided_lgp.documents import read_json, write_json
from guided_lgp.experiments import enumerate_sequences
from guided_lgp.logic import (
    parse_objective,
    two_goal_objectives,
)
from guided_lgp.params import load_params
from guided_lgp.paths import (
    EXAMPLES,
    MODELS,
)
from guided_lgp.planning import plan
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.tensors import read_tensors, write_tensors
from guided_lgp.scene import generate, load_scene, load_scenes
from guided_lgp.studies.cases import RESULTS
from stand_ins import NothingOnBlue

ROOT = Path(__file__).parents[2]
PARAMS = load_params(ROOT / "params.yaml")
CASE = "rows"
STUDY = ("spread", "feasibility", "feasibility_timing")
"""Files of the studies."""
GOALS = (
    "(on red green)",
    "(held blue)",
    "(held blue pr2L)",
    "(empty pr2R)",
    "(handempty)",
    "(at red 0.5 0.3 0.65 0.2 0.01 0.05)",
    "(at red tab1 0.5 0.3 0.65 0.2)",
    "(in red tab1 -0.1 -0.1 0.1 0.1)",
    "(upright red)",
    "(posture pr2R 0.1 0.2 -1.5 -1.2 0 -0.5 0)",
)


class Examples:
    """Good files of every kind, made in a folder when they are needed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def _new(self, name: str) -> Path:
        folder = self._folder / name
        folder.mkdir(parents=True)
        return folder

    @cached_property
    def scenes(self) -> Path:
        """The example scenes, and a plan."""
        folder = self._new("scenes")
        for file in EXAMPLES.glob("*.json"):
            shutil.copy(file, folder)
        start = load_scene(folder / "three_boxes.json")
        found = plan(start, ["(on red green)"])
        assert found.path is not None
        objective = parse_objective(["(on red green)"])
        write_plan(folder / "plan.json", start, objective, found.path, {"planner": "guided"})
        write_json(folder / "observed" / "state.json", _after_an_action(folder / "plan.json"))
        _write_whole_scene(folder)
        for number, goal in enumerate(GOALS):
            (folder / f"goal{number}.txt").write_text(goal)
        return folder

    @cached_property
    def skeletons(self) -> Path:
        """A scene, and what may begin a plan in it: text, a file for PDDL, a plan."""
        folder = self._new("skeletons")
        for name in ("three_boxes.json", "plan.json"):
            shutil.copy(self.scenes / name, folder)
        actions = read_plan(folder / "plan.json").actions
        (folder / "text.txt").write_text(" ".join(actions))
        (folder / "pddl.txt").write_text("; a plan\n" + "\n".join(actions).lower() + "\n")
        return folder

    @cached_property
    def parameters(self) -> Path:
        """The parameters of the pipeline, of planning and of the studies; its stages and lock."""
        folder = self._new("parameters")
        (folder / "studies").mkdir()
        for name in ("params.yaml", "studies/params.yaml", "dvc.yaml", "dvc.lock"):
            shutil.copy(ROOT / name, folder / name)
        params = yaml.safe_load((folder / "params.yaml").read_text())
        planning = {name: params[name] for name in ("bounds", "compare_scalability")}
        (folder / "planning.yaml").write_text(yaml.safe_dump(planning))
        return folder

    @cached_property
    def robot(self) -> Path:
        """A small robot with its description."""
        folder = self._new("robot")
        describe(folder, "left_", "right_")
        written(folder, document("left_", "right_"))
        return folder

    @cached_property
    def models(self) -> Path:
        """The shipped weights."""
        return Path(shutil.copytree(MODELS, self._folder / "models"))

    @cached_property
    def outputs(self) -> Path:
        """What all stages write, with made-up figures; and a data set."""
        folder = self._new("outputs")
        write_outputs(folder)
        return folder

    @cached_property
    def studies(self) -> Path:
        """What some of the studies have written."""
        folder = self._new("studies")
        (folder / RESULTS).mkdir(parents=True)
        for name in STUDY:
            shutil.copy(ROOT / RESULTS / f"{name}.json", folder / RESULTS)
        return folder

    @cached_property
    def case(self) -> Path:
        """A case: some demonstrations, the rows of two problems, and a result that is kept."""
        folder = self._new("case")
        arrays = read_tensors(demonstrations_of(ROOT, CASE), "make cases")
        few = {name: array[::50] for name, array in arrays.items()}
        write_tensors(demonstrations_of(folder, CASE), few)
        for training in (RIVALS, *map(str, PARAMS.cases[CASE].seeds)):
            for file in (outcomes_of, times_of):
                rows = read_json(file(ROOT, CASE, training))
                first = dict.fromkeys(row["scene"] for row in rows)
                two = [row for row in rows if row["scene"] in list(first)[:2]]
                write_json(file(folder, CASE, training), two)
        write_kept(folder / "kept.json", [{"numbers": [1, 2.5, None], "name": "red"}])
        return folder

    @cached_property
    def sequences(self) -> Path:
        """Scenes, the tables of their enumeration as if one action were feasible, a data set."""
        folder = self._new("sequences")
        generate("a", 2, 1, "scene").save(folder / "scenes.json")
        scenes = load_scenes(folder / "scenes.json").scenes
        write_enumeration(folder, scenes, two_goal_objectives(scenes[0].symbols))
        built(folder).save(folder / "dataset")
        return folder

    @cached_property
    def shard(self) -> Path:
        """The enumeration of a scene in which nothing stands on blue."""
        folder = self._new("shard")
        write_shard_in(folder)
        return folder

    @cached_property
    def tracked(self) -> Path:
        """A database of MLflow."""
        folder = self._new("tracked")
        with in_database(folder):
            tracking.prepare()
        return folder


def write_shard_in(folder: Path, seed: int = 1) -> Path:
    """Enumerate a scene unless that has been done; the folder of the shard."""
    (scene,) = generate("a", 1, seed, "x").scenes
    params = load_params(ROOT / "tests" / "params.yaml")
    task = enumerate_sequences.Task(scene, params.bounds, params.enumerate_sequences, "", folder)
    with patch.object(enumerate_sequences, "SceneBounds", NothingOnBlue):
        enumerate_sequences.write_shard(task)
    return task.shard


def in_database(folder: Path) -> AbstractContextManager[object]:
    """Record runs in a folder."""
    return patch.dict(os.environ, MLFLOW_TRACKING_URI=f"sqlite:///{folder / 'mlflow.db'}")


def _after_an_action(file: Path) -> dict[str, object]:
    """What is observed after the first action of a plan, a grasp."""
    found = read_plan(file)
    keyframe, grasp = found.keyframes[0], found.skeleton[0]
    robot = found.scene.robot.description
    fixed = {name for arm in robot.arms.values() for name in arm.fingers.joints}
    joints = dict(zip(found.joint_names, keyframe.q, strict=True))
    boxes = {
        name: {"position": box.position, "quaternion": box.quaternion}
        for name, box in keyframe.boxes.items()
    }
    gripper, box = grasp.symbols
    moved = {name: value for name, value in joints.items() if name not in fixed}
    return {"joints": moved, "boxes": boxes, "held": {box: gripper}}


def _write_whole_scene(folder: Path) -> None:
    """A scene with every field that there is, and the file of a mesh."""
    scene = json.loads((folder / "kitchen.json").read_text())
    scene |= {"domain": "pick_and_place"}
    scene["robot"] |= {"height": 0.0, "tilt": [0.0, 0.0], "joints": {"r_shoulder_pan_joint": -1.0}}
    tile = {"name": "tile", "size": [0.02, 0.06, 0.1], "position": [0.62, 0.22, 0.61]}
    turned = [0.0, 0.7071068, 0.0, 0.7071068]
    lying = {"quaternion": turned, "on": "counter", "colour": "#aa0000"}
    scene["boxes"].append(tile | lying | {"grasps": [[0, 0, 0.08, *turned]]})
    wedge = next(box for box in scene["boxes"] if box["name"] == "wedge")
    corners = wedge.pop("vertices")
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 2 3", "f 5 6 7"]
    (folder / "wedge.obj").write_text("\n".join(lines) + "\n")
    for name, mesh in {"whole.json": "wedge.obj", "surface.json": "wedge.stl"}.items():
        wedge["mesh"] = mesh
        (folder / name).write_text(json.dumps(scene))
    (folder / "wedge.stl").write_bytes(_stl(corners))


def _stl(corners: list[list[float]]) -> bytes:
    """The lower and the upper face of a wedge, in binary STL."""
    triangles = [[corners[n] for n in one] for one in ((0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7))]
    records = (
        np.array([[0, 0, 1], *triangle], "<f4").tobytes() + b"\0\0" for triangle in triangles
    )
    return bytes(80) + len(triangles).to_bytes(4, "little") + b"".join(records)


def built(folder: Path) -> Dataset:
    """The data set of the tables in a folder."""
    scenes = load_scenes(folder / "scenes.json").scenes
    objectives = two_goal_objectives(scenes[0].symbols)[:5]
    verdicts, shortest = folder / "verdicts.parquet", folder / "shortest.parquet"
    return build_dataset(scenes, verdicts, shortest, objectives, 0)
