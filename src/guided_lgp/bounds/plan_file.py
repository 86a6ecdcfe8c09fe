"""The file ``plan.json``: a plan that anyone can replay and check.

``q`` rows follow ``joint_names``; a box is rigid in the tool frame of the attachment's gripper from
``start`` to ``end`` (indices into ``times``), so that box poses follow from the scene, the
attachments and forward kinematics. Lengths in m, angles in rad, times in s.
"""

import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from guided_lgp.bounds.execution.forces import Grip, grips_of
from guided_lgp.bounds.results import Attachment, Keyframe, PathResult, Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.documents import read_json, write_text
from guided_lgp.faults import Document, validated
from guided_lgp.logic import Action, Goal, Objective, Skeleton
from guided_lgp.poses import yaw_of
from guided_lgp.scene import Scene

_DECIMALS = 6

Finite = Annotated[float, Field(allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-100, le=100)]
Time = Annotated[float, Field(ge=0, le=1e5)]
Index = Annotated[int, Field(strict=True, ge=0)]


class BoxPose(Document):
    """Where a box is; ``quaternion`` is ``[x, y, z, w]``, since a held box may be tilted."""

    position: tuple[Finite, Finite, Finite]
    yaw: Finite
    quaternion: tuple[Finite, Finite, Finite, Finite]


class PlanKeyframe(Document):
    """The configuration at the switch of one action."""

    q: tuple[Angle, ...]
    boxes: dict[str, BoxPose]


class PlanAttachment(Document):
    """The box is rigid in the gripper's tool frame from ``start`` to ``end``."""

    box: str
    gripper: str
    start: Index
    end: Index


class PlanPath(Document):
    """The dense motion."""

    times: Annotated[tuple[Time, ...], Field(min_length=1)]
    q: tuple[tuple[Angle, ...], ...]
    attachments: tuple[PlanAttachment, ...]


class PlanGrip(Document):
    """What a gripper is told to hold a box from its grasp on."""

    box: str
    gripper: str
    start: Index
    """Row of ``path`` at which it has closed."""
    width: Annotated[float, Field(gt=0, le=10)]
    """m of the side that the fingers close across."""
    closing: Finite
    """Value (rad or m) of the finger joints to close to: within the box, at which they stop."""
    force: Annotated[float, Field(gt=0, le=1000)]
    """N from either side."""
    ratio: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    """Largest share of what the pads can carry that box and riders take, at a friction of 0.6."""


class Plan(Document):
    """The whole file."""

    scene: Scene
    objective: tuple[str, ...]
    actions: tuple[str, ...]
    joint_names: tuple[str, ...]
    fixed_joints: dict[str, Finite]
    keyframes: tuple[PlanKeyframe, ...]
    path: PlanPath
    grips: tuple[PlanGrip, ...] = ()
    """One for each time that a gripper holds a box; plans of older versions have none."""
    statistics: dict[str, Any]
    verification: dict[str, Any]
    physics: dict[str, Any]

    @property
    def goals(self) -> Objective:
        """The objective that the plan achieves."""
        return tuple(map(Goal.parse, self.objective))

    @property
    def skeleton(self) -> Skeleton:
        """The actions a_1:K."""
        return tuple(map(Action.parse, self.actions))

    @property
    def trajectory(self) -> Trajectory:
        """The motion."""
        return Trajectory(
            self.joint_names,
            np.array(self.path.times),
            np.array(self.path.q),
            tuple(Attachment(**vars(attachment)) for attachment in self.path.attachments),
        )

    @model_validator(mode="after")
    def _consistent(self) -> "Plan":
        moving = self.scene.robot.description.moving_joints
        if sorted(self.joint_names) != sorted(moving):
            raise ValueError(f"joint_names are not the {len(moving)} of arms and fingers")
        rows, width = len(self.path.times), len(self.joint_names)
        if len(self.path.q) != rows:
            raise ValueError(f"path.q has {len(self.path.q)} rows for {rows} times")
        if any(len(row) != width for row in (*self.path.q, *(k.q for k in self.keyframes))):
            raise ValueError(f"a row q has not one value for each of {width} joint_names")
        if any(later <= earlier for earlier, later in pairwise(self.path.times)):
            raise ValueError("path.times do not increase")
        if len(self.keyframes) != len(self.actions):
            raise ValueError(f"{len(self.keyframes)} keyframes for {len(self.actions)} actions")
        symbols = self.scene.symbols
        for attachment in self.path.attachments:
            if attachment.box not in symbols.boxes or attachment.gripper not in symbols.grippers:
                raise ValueError(
                    f"attachment of unknown box or gripper: {attachment.box} {attachment.gripper}"
                )
            if not attachment.start <= attachment.end < rows:
                raise ValueError(f"attachment of {attachment.box} lies outside path.times")
        for grip in self.grips:
            if grip.box not in symbols.boxes or grip.gripper not in symbols.grippers:
                raise ValueError(f"grip of unknown box or gripper: {grip.box} {grip.gripper}")
            if grip.start >= rows:
                raise ValueError(f"grip of {grip.box} lies outside path.times")
        for text in self.objective:
            symbols.domain.goal_type(Goal.parse(text))
        for text in self.actions:
            symbols.domain.instruction(Action.parse(text))
        return self


def write_plan(
    path: Path,
    scene: Scene,
    objective: Objective,
    result: PathResult,
    statistics: Mapping[str, object],
    physics: Mapping[str, object] | None = None,
) -> None:
    """Write a plan.

    Args:
        path: the file; its folder is made.
        scene: the initial configuration.
        objective: the goals that the plan achieves.
        result: a feasible result of the path bound.
        statistics: tree size, attempts and times of the search.
        physics: outcome of the execution under gravity, if there was one.

    Raises:
        InputError: the file cannot be written.
    """
    trajectory = result.trajectory
    if trajectory is None:
        raise ValueError("an infeasible result has no plan")
    switches = switches_of(scene, result.skeleton, trajectory)
    assert isinstance(switches, list)  # the result has been verified
    rows = np.round(trajectory.q, _DECIMALS)
    document = {
        "scene": scene.model_dump(mode="json"),
        "objective": list(map(str, objective)),
        "actions": list(map(str, result.skeleton)),
        "joint_names": list(trajectory.joint_names),
        "fixed_joints": scene.robot.fixed_values,
        "keyframes": [
            {"q": rows[switch].tolist(), "boxes": _boxes(keyframe)}
            for switch, keyframe in zip(switches, result.at_switch, strict=True)
        ],
        "path": {
            "times": np.round(trajectory.times, _DECIMALS).tolist(),
            "q": rows.tolist(),
            "attachments": [vars(attachment) for attachment in trajectory.attachments],
        },
        "grips": [
            _rounded(grip) for grip in grips_of(scene, result.skeleton, switches, trajectory)
        ],
        "statistics": dict(statistics),
        "verification": dict(result.verification),
        "physics": dict(physics or {}),
    }
    lines = (
        f"{json.dumps(key)}: {json.dumps(value, separators=(',', ':'), allow_nan=False)}"
        for key, value in document.items()
    )
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_plan(path: Path) -> Plan:
    """Read a plan.

    Raises:
        InputError: the file is missing, is not JSON, or is not a plan; the message names the
            field and the fault.
    """
    return parse_plan(read_json(path, "a plan as written by guided-lgp plan --out"), str(path))


def parse_plan(document: object, where: str) -> Plan:
    """Validate the document of a plan.

    Args:
        document: what ``json.load`` returned.
        where: the file, for the message.

    Raises:
        InputError: the first fault found, with file and field.
    """
    return validated(Plan.model_validate, document, where)


def _rounded(grip: Grip) -> dict[str, object]:
    return {k: round(v, _DECIMALS) if isinstance(v, float) else v for k, v in vars(grip).items()}


def _boxes(keyframe: Keyframe) -> dict[str, object]:
    return {
        name: {
            "position": np.round(pose[:3], _DECIMALS).tolist(),
            "yaw": round(float(yaw_of(pose)), _DECIMALS),
            "quaternion": np.round(pose[3:], _DECIMALS).tolist(),
        }
        for name, pose in keyframe.boxes.items()
    }
