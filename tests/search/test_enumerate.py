"""Exhaustive enumeration against brute force over the logic tree."""

from itertools import product

import pytest
from scripted import ScriptedBounds

from guided_lgp.logic import (
    Skeleton,
    applicable_actions,
    one_goal_objectives,
    parse_objective,
    progress,
    satisfied,
    successor,
    two_goal_objectives,
)
from guided_lgp.scene.model import Scene
from guided_lgp.search.enumerate import enumerate_sequences


def reachable(skeleton: Skeleton) -> bool:
    """The left hand reaches neither tab2 nor green, and nothing can stand on blue."""
    gripper, box, *support = skeleton[-1].symbols
    left = gripper == "pr2L"
    return (
        not (left and support == ["tab2"]) and not (left and box == "green") and support != ["blue"]
    )


def feasible_sequences(scene: Scene, length: int) -> list[Skeleton]:
    sequences: list[tuple[Skeleton, object]] = [((), scene.state)]
    for _ in range(length):
        sequences = [
            ((*skeleton, action), successor(state, action))
            for skeleton, state in sequences
            for action in applicable_actions(state, scene.symbols)
            if reachable((*skeleton, action))
        ]
    return [skeleton for skeleton, _ in sequences]


@pytest.mark.parametrize("slack", [0, 1])
def test_no_shortest_sequence_is_missed(scene: Scene, slack: int) -> None:
    symbols = scene.symbols
    objectives = one_goal_objectives(symbols) + two_goal_objectives(symbols)
    found = enumerate_sequences(
        scene.state, symbols, objectives, ScriptedBounds(scene, reachable), 4, slack
    )
    feasible = {verdict.skeleton for verdict in found.verdicts if verdict.feasible}
    expected: dict[object, int] = {o: 0 for o in objectives if satisfied(scene.state, o)}
    for length in range(1, 5):
        ends = [(s, progress(scene.state, s)) for s in feasible_sequences(scene, length)]
        for objective, (skeleton, end) in product(objectives, ends):
            if not satisfied(end, objective):
                continue
            if expected.setdefault(objective, length) + slack >= length and (
                expected[objective] > 0
            ):
                assert skeleton in feasible
    assert found.shortest == {o: expected.get(o) for o in objectives}
    assert found.shortest[parse_objective(["(on red blue)"])] is None
    assert found.symbolic[parse_objective(["(on red blue)"])] == 2


def test_verdicts_are_shared_and_prefixes_prune(scene: Scene) -> None:
    bounds = ScriptedBounds(scene, reachable)
    objectives = two_goal_objectives(scene.symbols)
    found = enumerate_sequences(scene.state, scene.symbols, objectives, bounds, 4)
    assert len(bounds.coarse_asked) == len(set(bounds.coarse_asked)) == len(found.verdicts)
    for verdict in found.verdicts:
        assert all(reachable(verdict.skeleton[:k]) for k in range(1, len(verdict.skeleton)))


def test_solved_objectives_cost_nothing_more(scene: Scene) -> None:
    bounds = ScriptedBounds(scene)
    found = enumerate_sequences(
        scene.state, scene.symbols, one_goal_objectives(scene.symbols), bounds, 6
    )
    assert max(len(verdict.skeleton) for verdict in found.verdicts) == 2
    assert set(found.shortest.values()) == {0, 1, 2}
