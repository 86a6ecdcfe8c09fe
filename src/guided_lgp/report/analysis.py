"""What verdicts and outcomes say, as small tables of numbers."""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from itertools import permutations
from typing import Any

import pandas as pd

from guided_lgp.experiments.outcomes import BOUND_COUNTS
from guided_lgp.logic import (
    Goal,
    Objective,
    State,
    Symbols,
    format_objective,
    one_goal_objectives,
    parse_objective,
    parse_skeleton,
    progress,
    two_goal_objectives,
)
from guided_lgp.scene import Scene

BOX, HELD_BOX = "box", "held box"
_BETWEEN = ("clear", "apart", "beside", "stand", "balanced")
"""Constraints of which the kinds of the two bodies matter."""


def read_objective(text: str) -> Objective:
    """An objective as :func:`guided_lgp.logic.format_objective` writes it."""
    return parse_objective(re.findall(r"\([^()]*\)", text))


def objective_kind(objective: str, boxes: Collection[str]) -> str:
    """The types of an objective's goals, such as ``held + on box``.

    Args:
        objective: as :func:`guided_lgp.logic.format_objective` writes it.
        boxes: names of the boxes; a goal on another table counts as ``on table``.
    """
    kinds = []
    for goal in read_objective(objective):
        others = ("box" if name in boxes else "table" for name in goal.symbols[1:])
        kinds.append(" ".join((goal.kind, *others)))
    return " + ".join(sorted(kinds))


def outcomes(problems: pd.DataFrame, scenes: Mapping[str, Scene]) -> pd.DataFrame:
    """Planner, kind of objective and outcome of the problems not satisfied at the start."""
    counted = problems[problems["outcome"] != "trivial"]
    pairs = zip(counted["objective"], counted["configuration"], strict=True)
    kinds = [objective_kind(text, scenes[name].symbols.boxes) for text, name in pairs]
    return counted[["planner", "outcome"]].assign(kind=kinds)


SEEN, RENAMED, NEW = "seen", "renamed", "new"


def novelty(symbols: Symbols, training: Iterable[Objective]) -> dict[str, str]:
    """How new every objective of one and two goals is, by its text.

    Args:
        symbols: of the setup.
        training: the objectives that the policy was trained on.

    Returns:
        ``seen``: drawn for training; ``renamed``: not, but a training objective becomes it when
        the boxes are renamed; ``new``: neither.
    """
    seen = {frozenset(objective) for objective in training}
    renamed = {
        frozenset(_rename(goal, dict(zip(symbols.boxes, names, strict=True))) for goal in objective)
        for objective in seen
        for names in permutations(symbols.boxes)
    }
    kinds = {}
    for objective in one_goal_objectives(symbols) + two_goal_objectives(symbols):
        goals = frozenset(objective)
        unseen = RENAMED if goals in renamed else NEW
        kinds[format_objective(objective)] = SEEN if goals in seen else unseen
    return kinds


def _rename(goal: Goal, names: Mapping[str, str]) -> Goal:
    return replace(goal, symbols=tuple(names.get(name, name) for name in goal.symbols))


def by_novelty(problems: pd.DataFrame, kinds: Mapping[str, str]) -> pd.DataFrame:
    """Share of problems with a shortest solution by planner and novelty of the objective.

    Args:
        problems: columns planner, objective and outcome.
        kinds: see :func:`novelty`.

    Returns:
        Columns planner, kind, n (problems not satisfied at the start), shortest.
    """
    counted = problems[problems["outcome"] != "trivial"]
    frame = pd.DataFrame(
        {
            "planner": counted["planner"],
            "kind": counted["objective"].map(kinds),
            "shortest": counted["outcome"] == "shortest",
        }
    )
    groups: Any = frame.groupby(["planner", "kind"])["shortest"]
    return pd.DataFrame({"n": groups.size(), "shortest": groups.mean()}).reset_index()


def calls(problems: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Mean calls to a plan by planner, over the problems solved.

    Args:
        problems: columns planner, length, policy_calls and :data:`BOUND_COUNTS`; all but the first
            empty without a plan.

    Returns:
        ``policy_calls`` per action of the plan, and the others as they are.
    """
    solved = problems[problems["length"].notna() & (problems["length"] > 0)]
    figures = solved[list(BOUND_COUNTS)].astype(float)
    figures["policy_calls"] = solved["policy_calls"] / solved["length"]
    means: Any = figures.groupby(solved["planner"]).mean()
    return {str(name): row.to_dict() for name, row in means.iterrows()}


def by_length(verdicts: pd.DataFrame) -> list[dict[str, Any]]:
    """Sequences tried and the share infeasible: keys split, length, n, infeasible_share."""
    groups: Any = verdicts.groupby(["split", "length"])["feasible"]
    return [
        {
            "split": split,
            "length": int(length),
            "n": len(group),
            "infeasible_share": 1.0 - float(group.mean()),
        }
        for (split, length), group in groups
    ]


def by_last_action(verdicts: pd.DataFrame, scenes: Mapping[str, Scene]) -> pd.DataFrame:
    """How often a sequence stays feasible with one more action, by that action.

    Every sequence that was tried has a feasible prefix, so its verdict is about its last action.

    Args:
        verdicts: columns configuration, skeleton, feasible.
        scenes: by name of the configuration.

    Returns:
        Columns instruction, gripper, table (where the box is taken from or put: the name of a
        table, ``box`` or ``held box``), n, feasible.
    """
    before: dict[tuple[str, str], State] = {}
    rows = []
    symbols_of = {name: scene.symbols for name, scene in scenes.items()}
    columns = verdicts[["configuration", "skeleton", "feasible"]]
    for configuration, skeleton, feasible in columns.itertuples(index=False):
        symbols = symbols_of[configuration]
        start = skeleton.rindex("(")
        prefix = skeleton[:start]
        state = before.get((configuration, prefix))
        if state is None:
            state = progress(scenes[configuration].state, parse_skeleton(prefix))
            before[configuration, prefix] = state
        (action,) = parse_skeleton(skeleton[start:])
        ground = symbols.domain.bind(action)
        table = state.parent_of(ground.body) if ground.into_hand else ground.parent
        if table in symbols.boxes:
            table = BOX if state.holder(table) is None else HELD_BOX
        rows.append((action.instruction, ground.actor, table, feasible))
    frame = pd.DataFrame(rows, columns=["instruction", "gripper", "table", "feasible"])
    groups = frame.groupby(["instruction", "gripper", "table"])["feasible"]
    return pd.DataFrame({"n": groups.size(), "feasible": groups.sum()}).reset_index()


def failures(verdicts: pd.DataFrame, scenes: Mapping[str, Scene]) -> pd.DataFrame:
    """Infeasible sequences by the constraint that stays violated and the action at which it does.

    Returns:
        Index: constraint, the most frequent first; columns: action, from 1.
    """
    explained = verdicts["failure_constraint"].notna() & verdicts["failure_action"].notna()
    failed = verdicts[~verdicts["feasible"].astype(bool) & explained]
    pairs = zip(failed["failure_constraint"], failed["configuration"], strict=True)
    kinds = [constraint_kind(name, scenes[configuration]) for name, configuration in pairs]
    actions = failed["failure_action"].astype(int).to_numpy() + 1
    counts = pd.crosstab(pd.Series(kinds, dtype=str).to_numpy(), actions)
    order = counts.sum(axis=1).sort_values(ascending=False, kind="stable").index
    return counts.loc[order]


def constraint_kind(constraint: str, scene: Scene) -> str:
    """A constraint without names of bodies.

    ``clear l_forearm_link tab2`` becomes ``clear robot–table``, ``hold pr2L red`` becomes
    ``hold``.
    """
    kinds = {body.name: type(body).__name__.lower() for body in scene.bodies}
    kinds |= dict.fromkeys(scene.symbols.grippers, "robot")
    words = [word for word in constraint.split() if word != "of"]
    bodies = [kinds.get(word, "robot" if "_" in word else "") for word in words]
    kind = " ".join(word for word, body in zip(words, bodies, strict=True) if not body)
    named = [body for body in bodies if body]
    if kind in _BETWEEN:
        return f"{kind} {'–'.join(sorted(named))}"
    return kind
