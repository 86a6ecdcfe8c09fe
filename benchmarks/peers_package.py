"""What runs in the environment of ``robotic``: KOMO's keyframes for given scenes and skeletons.

    python peers_package.py FOLDER

Reads ``problems.json``, see ``peers.py``, and writes ``answers.json``: by problem, CPU seconds, and
what became of KOMO's starts, until one is feasible. Nothing of this project is imported. Frames and
constraints are those of the package's own ``KOMO_ManipulationHelper``, as its tutorial on
manipulation uses them.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import robotic as ry

ROBOT = "../rai-robotModels/scenarios/panda_fixGripper.g"
GRIPPER, PALM = "gripper", "palm"
ROUND = 0.005
"""Radius (m) of the edges of boxes, as in the tutorial."""
STARTS = 12


def answer(problem):
    began = time.process_time()
    configuration = _configuration(problem)
    made = time.process_time()
    starts = []
    while len(starts) < STARTS and not (starts and starts[-1]["feasible"]):
        starts.append(_solve(configuration, problem["skeleton"], at_random=bool(starts)))
    return {
        "komo": starts[-1]["feasible"],
        "komo_first_start": starts[0]["feasible"],
        "komo_errors": starts[-1]["errors"],
        "komo_scene_s": made - began,
        "komo_s": time.process_time() - made,
    }


def _configuration(problem):
    configuration = ry.Config()
    configuration.addFile(ry.raiPath(ROBOT))
    configuration.setJointState(problem["joints"])
    for body in (*problem["tables"], *problem["boxes"]):
        frame = configuration.addFrame(body["name"], body["on"])
        if body["on"]:
            frame.setJoint(ry.JT.rigid)
        frame.setShape(ry.ST.ssBox, [*body["size"], ROUND]).setContact(1)
        frame.setPosition(body["position"])
        frame.setQuaternion([np.cos(body["yaw"] / 2), 0, 0, np.sin(body["yaw"] / 2)])
    return configuration


def _solve(configuration, skeleton, at_random):
    """Formulate and solve; the first start is the one that KOMO takes by itself."""
    program = ry.KOMO_ManipulationHelper()
    program.setup_sequence(configuration, len(skeleton))
    for phase, (instruction, box, *support) in enumerate(skeleton, start=1):
        if instruction == "grasp":
            _grasp(program, phase, box)
        else:
            _place(program, phase, box, *support, last=phase == len(skeleton))
    if at_random:
        program.komo.initRandom()
    found = program.solve(verbose=0)
    return {"feasible": found.feasible, "errors": found.eq + found.ineq}


def _grasp(program, phase, box):
    """The fingers close along the box's y axis, anywhere and at any angle about it."""
    program.add_stable_frame(ry.JT.free, GRIPPER, f"grasp{phase}", initFrame=box)
    program.snap_switch(phase, f"grasp{phase}", box)
    program.grasp_box(phase, GRIPPER, box, PALM, "y")


def _place(program, phase, box, support, last):
    """Upright on the support; from there it goes on, unless this is the end.

    The place is looked for from the support's middle. From where the box stands, as the package's
    C++ does it, KOMO solves 17 of the 40 near skeletons of four actions; so it solves all.
    """
    if not last:
        program.add_stable_frame(ry.JT.free, support, f"place{phase}")
        program.snap_switch(phase, f"place{phase}", box)
    program.place_box(phase, box, support, PALM)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    problems = json.loads((folder / "problems.json").read_text())
    (folder / "answers.json").write_text(json.dumps([answer(problem) for problem in problems]))
