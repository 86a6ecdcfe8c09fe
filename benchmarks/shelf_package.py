"""What runs in the environment of ``guided-tamp-benchmark``: tasks out, motions in, judged.

    python shelf_package.py tasks FOLDER [NAME ...]
    python shelf_package.py judge FOLDER

The first writes one JSON document for each demonstration and base pose, or for those that are
named, see ``shelf_scenes.py``.
The second reads ``answers.json`` and the motions that it names, hands them back through the planner
interface of the package, and writes ``verdicts.json``. Nothing of this project is imported.
"""

import json
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pinocchio as pin
from guided_tamp_benchmark.benchmark import Benchmark
from guided_tamp_benchmark.core import BasePlanner, Configuration
from guided_tamp_benchmark.core import Path as PlannedPath
from guided_tamp_benchmark.models.robots import PandaRobot
from guided_tamp_benchmark.tasks import ShelfTask

DEMONSTRATIONS, BASES = 3, range(1, 11)
"""Base 0 is the origin of the world: a placeholder."""


def names():
    return [
        (f"shelf_{demo}_{base}", demo, base) for demo in range(DEMONSTRATIONS) for base in BASES
    ]


def write_tasks(folder, *wanted):
    for name, demo, base in names():
        if wanted and name not in wanted:
            continue
        task = ShelfTask(demo, PandaRobot(), base)
        document = {
            "name": name,
            "demonstration": demo,
            "base": base,
            "accepted": _accepted(task),
            "robot": _robot(task),
            **_furniture(task),
            "bodies": [_body(task, number) for number in range(len(task.objects))],
        }
        (folder / f"{name}.json").write_text(json.dumps(document))


def _accepted(task):
    """Whether its own check finds no collision where a task begins and ends."""
    start, goal = (_at_rest(task, step) for step in (0, -1))
    with redirect_stdout(StringIO()):
        return all(task.collision.is_config_valid(end) for end in (start, goal))


def _at_rest(task, step):
    return Configuration(
        task.robot.initial_configuration(), task.demo.subgoal_objects_poses[:, step]
    )


def _robot(task):
    (gripper,) = task.robot.get_grippers_info().values()
    return {
        "base": _numbers(pin.SE3(task.demo.robot_pose)),
        "joints": task.robot.initial_configuration(),
        "gripper": _numbers(_pose(gripper["pose"])),
    }


def _furniture(task):
    model, geometry = task.collision.pin_mod, task.collision.col_mod
    data, places = model.createData(), pin.GeometryData(geometry)
    pin.updateGeometryPlacements(model, data, geometry, places, pin.neutral(model))
    boxes = [
        {"name": part.name, "size": (2 * part.geometry.halfSide).tolist(), "pose": _numbers(place)}
        for part, place in zip(geometry.geometryObjects, places.oMg, strict=True)
        if part.parentJoint == 0 and hasattr(part.geometry, "halfSide")
    ]
    pin.updateFramePlacements(model, data)
    surfaces = []
    for number, furniture in enumerate(reversed(task.furniture), start=len(task.objects)):
        for name, contact in furniture.get_contacts_info().items():
            frame = model.getFrameId(f"{contact['link']}_{furniture.name}_{number}")
            for place, shape in enumerate(contact["shapes"]):
                corners = [data.oMf[frame].act(corner).tolist() for corner in shape]
                surfaces.append({"name": f"{name}_{place}", "corners": corners})
    return {"boxes": boxes, "surfaces": surfaces}


def _body(task, number):
    item = task.objects[number]
    (part,) = (p for p in task.collision.col_mod.geometryObjects if item.name in p.name)
    (contact,) = item.get_contacts_info().values()
    poses = task.demo.subgoal_objects_poses[number]
    return {
        "name": item.name,
        "vertices": part.geometry.vertices().tolist(),
        "corners": contact["shapes"].reshape(-1, 3).tolist(),
        "handles": [_numbers(_pose(handle["pose"])) for handle in item.get_handles_info().values()],
        "start": _numbers(pin.SE3(poses[0])),
        "goal": _numbers(pin.SE3(poses[-1])),
    }


def _pose(numbers):
    """Of x, y, z and a quaternion whose scalar comes first."""
    return pin.XYZQUATToSE3(np.array([*numbers[:3], *numbers[4:], numbers[3]]))


def _numbers(pose):
    return pin.SE3ToXYZQUAT(pose).tolist()


class Samples(PlannedPath):
    """A motion as dense samples: joints (n, 9) and poses (n, bodies, 7)."""

    def __init__(self, file):
        motion = np.load(file)
        self.joints = motion["joints"]
        self.poses = [
            [pin.XYZQUATToSE3(pose).homogeneous for pose in row] for row in motion["poses"]
        ]

    def interpolate(self, t):
        """The nearest sample."""
        last = len(self.joints) - 1
        row = min(last, round(t * last))
        return Configuration(self.joints[row], self.poses[row])


class Answered(BasePlanner):
    """The planner, which has been asked before."""

    def __init__(self, task, max_planning_time, random_seed, motion):
        super().__init__(task, max_planning_time, random_seed)
        self.motion = motion

    @property
    def name(self):
        """Of the planner."""
        return "guided-lgp"

    def solve(self):
        """Whether there is a plan."""
        return self.motion is not None

    def get_path(self):
        """The plan."""
        return Samples(self.motion)


def judge(folder):
    answers = json.loads((folder / "answers.json").read_text())
    verdicts = {}
    for name, demo, base in names():
        if answers.get(name) is not None:
            task = ShelfTask(demo, PandaRobot(), base)
            with redirect_stdout(StringIO()):
                verdicts[name] = _verdict(task, str(folder / answers[name]))
            print(name, *verdicts[name].values(), flush=True)
    (folder / "verdicts.json").write_text(json.dumps(verdicts))


def _verdict(task, motion):
    benchmark, path = Benchmark(), Samples(motion)
    benchmark.do_benchmark(task, Answered, seeds=[0], planner_arg={"motion": motion}, delta=0.001)
    results = benchmark.results["guided-lgp"]["shelf"][task.demo.demo_id]
    result = results[task.robot.name][task.demo.pose_id][0]
    successful, says = task.path_is_successful(path, 1 / (len(path.joints) - 1))
    return {"successful": successful, "says": says, "grasps": result.number_of_grasps}


if __name__ == "__main__":
    {"tasks": write_tasks, "judge": judge}[sys.argv[1]](Path(sys.argv[2]), *sys.argv[3:])
