"""What the verdicts and the outcomes say, as small tables of numbers."""

import re
from collections.abc import Collection, Mapping

import pandas as pd

from guided_lgp.logic import Goal, State, parse_skeleton, successor
from guided_lgp.scene import GRIPPERS, Scene

BOX, HELD_BOX = "box", "held box"


def objective_kind(objective: str, boxes: Collection[str]) -> str:
    """The types of an objective's goals, such as ``held + on box``.

    Args:
        objective: as :func:`guided_lgp.logic.format_objective` writes it.
        boxes: the names of the boxes; goals on any other table count as ``on table``.
    """
    kinds = []
    for text in re.findall(r"\([^()]*\)", objective):
        goal = Goal.parse(text)
        kinds.append("held" if goal.kind == "held" else f"on {'box' if goal.table in boxes else 'table'}")
    return " + ".join(sorted(kinds))


def by_length(verdicts: pd.DataFrame) -> pd.DataFrame:
    """Sequences tried and the share that is infeasible, by split and number of actions."""
    groups = verdicts.groupby(["split", "length"], sort=True)["feasible"]
    return pd.DataFrame({"n": groups.size(), "infeasible_share": 1 - groups.mean()}).reset_index()


def by_last_action(verdicts: pd.DataFrame, scenes: Mapping[str, Scene]) -> pd.DataFrame:
    """How often a sequence stays feasible with one more action, by arm and table.

    Every sequence that was tried has a feasible prefix, so its verdict is about its last action.

    Args:
        verdicts: columns configuration, skeleton, feasible.
        scenes: by name of the configuration.

    Returns:
        Columns instruction, gripper, table (where the box is taken from, or put on), n, feasible.
    """
    states: dict[tuple[str, str], State] = {}
    rows = []
    for configuration, text, feasible in verdicts[["configuration", "skeleton", "feasible"]].itertuples(index=False):
        prefix, last = _split_last(text)
        scene = scenes[configuration]
        before = states.get((configuration, prefix))
        if before is None:
            before = scene.state
            for action in parse_skeleton(prefix):
                before = successor(before, action)
            states[configuration, prefix] = before
        (action,) = parse_skeleton(last)
        table = action.table or before.support_of(action.box)
        assert table is not None
        if before.holder(table) is not None:
            table = HELD_BOX
        elif table in scene.symbols.boxes:
            table = BOX
        rows.append((action.instruction, action.gripper, table, feasible))
    frame = pd.DataFrame(rows, columns=["instruction", "gripper", "table", "feasible"])
    groups = frame.groupby(["instruction", "gripper", "table"], sort=True)["feasible"]
    return pd.DataFrame({"n": groups.size(), "feasible": groups.sum()}).reset_index()


def failures(verdicts: pd.DataFrame, scenes: Mapping[str, Scene]) -> pd.DataFrame:
    """Infeasible sequences by the constraint that stays violated and the action at which it does.

    Returns:
        Index: constraint, the most frequent first; columns: action, from 1.
    """
    failed = verdicts[~verdicts["feasible"].astype(bool)]
    constraints = [
        constraint_kind(name, scenes[configuration])
        for name, configuration in zip(failed["failure_constraint"], failed["configuration"], strict=True)
    ]
    counts = pd.crosstab(pd.Series(constraints, dtype=str).to_numpy(), failed["failure_action"].to_numpy() + 1)
    return counts.loc[counts.sum(axis=1).sort_values(ascending=False, kind="stable").index]


def constraint_kind(constraint: str, scene: Scene) -> str:
    """A constraint without names: ``collision l_forearm_link tab2`` is ``collision robot, table``."""
    kind, *bodies = constraint.split()
    names = {table.name: "table" for table in scene.tables} | {b.name: "box" for b in scene.boxes}
    names |= dict.fromkeys(GRIPPERS, "robot")
    known = [names.get(body, "robot") if "_" in body or body in names else body for body in bodies]
    return " ".join([kind, ", ".join(sorted(known))]).strip()


def _split_last(skeleton: str) -> tuple[str, str]:
    start = skeleton.rindex("(")
    return skeleton[:start].rstrip(), skeleton[start:]
