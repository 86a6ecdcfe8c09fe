"""Facts: true of every configuration of an arm, and of every verdict of the solver."""

from collections.abc import Iterator

import numpy as np
import pytest

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.facts import Facts
from guided_lgp.bounds.coarse.unreachable import Limb
from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.results import Array
from guided_lgp.logic import Skeleton, applicable_actions, parse_skeleton, successor
from guided_lgp.poses import rotation_matrix
from guided_lgp.scene import Scene, generate
from guided_lgp.scene.bodies import Box, Table

LEFT = Table(name="left", position=(0.54, 0.4, 0.6), half_extents=(0.17, 0.2))
RIGHT = Table(name="right", position=(0.54, -0.4, 0.6), half_extents=(0.17, 0.2))
FAR = Table(name="far", position=(1.4, 0.0, 0.6), half_extents=(0.1, 0.1))
SIZE = (0.15, 0.07, 0.1)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """One box at the left, one at the right, one out of reach."""
    places = {"red": LEFT, "green": RIGHT, "blue": FAR}
    boxes = tuple(
        Box(name=name, size=SIZE, position=(*table.position[:2], 0.65), on=table.name)
        for name, table in places.items()
    )
    return Scene(tables=(LEFT, RIGHT, FAR), boxes=boxes)


@pytest.fixture(scope="module")
def facts(scene: Scene) -> Facts:
    return Facts(SceneGeometry(scene))


@pytest.mark.parametrize("gripper", ["pr2L", "pr2R"])
@pytest.mark.parametrize("spread", [0.0, 0.04])
def test_what_a_configuration_reaches_is_never_denied(
    scene: Scene, gripper: str, spread: float
) -> None:
    """Wrists of random configurations, moved and turned within the stated bounds."""
    placed = scene.robot
    robot = placed.description
    arm = robot.arms[gripper]
    limb = Limb.of(kinematics_of(robot).arms[gripper], placed.fixed_values)
    assert limb is not None
    generator = np.random.default_rng(0)
    count = 300
    q = np.tile(robot.home, (count, 1))
    q[:, arm.slice] = generator.uniform(*arm.limits.T, (count, len(arm.joints)))
    poses = placed.link_poses(q, (arm.tool_link,))[:, 0]
    tool = np.array([rotation_matrix(pose[3:])[:, 0] for pose in poses])
    wrist = poses[:, :3] - limb.hand * tool + _balls(generator, count, spread)
    pan = q[:, arm.slice][:, 0] + generator.uniform(-spread, spread, count)
    x, y = tool[:, 0], tool[:, 1]
    turned = np.stack(
        [np.cos(pan) * x + np.sin(pan) * y, np.cos(pan) * y - np.sin(pan) * x, tool[:, 2]]
    )
    radius = np.full(count, spread + 1e-6)
    assert limb.reaches(wrist.T, radius, turned, spread, pan, spread).all()


def _balls(generator: np.random.Generator, count: int, radius: float) -> Array:
    directions = generator.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(radius * generator.uniform(0, 1, (count, 1)) * directions)


@pytest.mark.parametrize(
    ("skeleton", "impossible"),
    [
        ("(grasp pr2L red)", False),
        ("(grasp pr2R green)", False),
        ("(grasp pr2L blue)", True),
        ("(grasp pr2L red) (grasp pr2R blue)", True),
        ("(grasp pr2L red) (place pr2L red left)", False),
        ("(grasp pr2L red) (place pr2L red far)", True),
        ("(grasp pr2L red) (place pr2L red blue)", True),
        ("(grasp pr2L red) (place pr2L red right) (grasp pr2R red)", False),
        # Not on a body at its start: no fact, the solver decides.
        (
            "(grasp pr2R green) (place pr2R green right) (grasp pr2L red) (place pr2L red green)",
            False,
        ),
    ],
)
def test_facts_of_a_small_scene(facts: Facts, skeleton: str, impossible: bool) -> None:
    assert (facts.impossible(parse_skeleton(skeleton)) is not None) == impossible


def random_skeletons(scene: Scene, count: int, length: int) -> Iterator[Skeleton]:
    generator = np.random.default_rng(1)
    for _ in range(count):
        state, skeleton = scene.state, Skeleton()
        for _ in range(length):
            actions = list(applicable_actions(state, scene.symbols))
            action = actions[generator.integers(len(actions))]
            state, skeleton = successor(state, action), (*skeleton, action)
        yield skeleton


def test_the_solver_finds_nothing_that_a_fact_denies(monkeypatch: pytest.MonkeyPatch) -> None:
    """And verdicts with facts are those without."""
    for scene in generate("a", 3, 17, "facts").scenes:
        skeletons = list(random_skeletons(scene, 6, 3))
        with_facts = [CoarseBound(scene, 4).solve(skeleton) for skeleton in skeletons]
        with monkeypatch.context() as patch:
            patch.setattr(Facts, "impossible", lambda self, skeleton: None)
            without = [CoarseBound(scene, 4).solve(skeleton) for skeleton in skeletons]
        assert [r.feasible for r in with_facts] == [r.feasible for r in without]


def test_a_denied_skeleton_counts_no_start(scene: Scene) -> None:
    result = CoarseBound(scene, 12).solve(parse_skeleton("(grasp pr2L blue)"))
    assert (result.feasible, result.restarts) == (False, 0)
    assert result.failure is not None
    assert str(result.failure) == (
        "action 1: hold pr2L blue violated (proved for the arm alone, collisions left out)"
    )


def test_a_fact_is_proved_only_where_a_start_fails(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    proved: list[Limb] = []
    monkeypatch.setattr(Limb, "cannot", lambda limb, grasp: bool(proved.append(limb)) or True)
    assert CoarseBound(scene, 12).solve(parse_skeleton("(grasp pr2L red)")).feasible
    assert not proved
    assert not CoarseBound(scene, 12).solve(parse_skeleton("(grasp pr2L blue)")).feasible
    assert proved
