"""Level sizes, distances and cost of the logic tree."""

import time

import pytest

from guided_lgp.domains import load_domain
from guided_lgp.logic import State, Symbols, parse_objective, parse_skeleton
from guided_lgp.search.tree import LogicTree, StateSpace, distances

GRIPPERS = ("pr2L", "pr2R")
COLOURS = ("red", "green", "blue", "yellow", "orange")
SETUP_A = load_domain().symbols(gripper=GRIPPERS, box=COLOURS[:3], table=("tab1", "tab2"))
REDUCED_B = SETUP_A.restricted(table=("tray", "tab2"))
SETUP_D = load_domain().symbols(gripper=GRIPPERS, box=COLOURS, table=("tab1", "tab2", "tray"))


def on_tab1(boxes: int) -> State:
    return load_domain().state(dict.fromkeys(COLOURS[:boxes], "tab1"))


@pytest.mark.parametrize(
    ("symbols", "sizes"),
    [
        (SETUP_A, [1, 6, 36, 240, 1392]),
        (REDUCED_B, [1, 6, 24, 120, 480, 2400, 9600]),
    ],
)
def test_level_sizes(symbols: Symbols, sizes: list[int]) -> None:
    tree = LogicTree(symbols, on_tab1(3))
    level = range(1)
    counted = [len(level)]
    for _ in sizes[1:]:
        children = [tree.expand(node) for node in level]
        level = range(children[0].start, children[-1].stop)
        counted.append(len(level))
    assert counted == sizes
    assert len(tree) == sum(sizes)


def test_nodes_know_their_sequence() -> None:
    tree = LogicTree(SETUP_A, on_tab1(3))
    child = tree.expand(0)[1]
    grandchild = tree.expand(child)[0]
    assert tree.skeleton(grandchild) == parse_skeleton("(grasp pr2L green) (place pr2L green tab1)")
    assert tree.skeleton(0) == ()


def test_reachable_states_of_setup_a() -> None:
    # Forests of three boxes: 9 with one root, 6 with two, 1 with three; roots stand on one of two
    # tables or are held by a gripper, at most one each: 4, 14 and 44 ways.
    space = StateSpace(SETUP_A, on_tab1(3))
    space.explore()
    assert len(space) == 9 * 4 + 6 * 14 + 1 * 44


def test_distances() -> None:
    space = StateSpace(SETUP_A, on_tab1(3))
    space.explore()
    tower = parse_objective(["(on red green)", "(on green blue)"])
    assert distances(space, tower)[0] == 4
    assert distances(space, parse_objective(["(held red)"]))[0] == 1


def test_a_large_tree_is_fast_and_small() -> None:
    tree = LogicTree(SETUP_D, on_tab1(5))
    start = time.process_time()
    node = 0
    while len(tree) < 400_000:
        tree.expand(node)
        node += 1
    assert time.process_time() - start < 10
    # Only few symbolic states are behind the nodes: what a node costs is its three integers.
    assert len(tree.space) < len(tree) / 20
