"""The draw of the training objectives (paper, Table V)."""

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.logic import Objective, Symbols, two_goal_objectives

_DRAWS = 10_000


def training_objectives(symbols: Symbols, count: int, seed: int) -> list[Objective]:
    """Draw two-goal objectives for training, such that every goal occurs in at least one.

    The draw is uniform over all such choices: whole draws are repeated until one covers the goals.

    Args:
        symbols: the symbols of the setup.
        count: how many of the two-goal objectives (72 in setup a) are for training.
        seed: of the draw.

    Returns:
        ``count`` objectives in the order of :func:`guided_lgp.logic.two_goal_objectives`.

    Raises:
        InputError: there are fewer objectives, or none of 10,000 draws covers every goal.
    """
    objectives = two_goal_objectives(symbols)
    if not 1 <= count <= len(objectives):
        raise InputError(
            "build_dataset.training_objectives",
            f"{count} of {len(objectives)} two-goal objectives",
            f"1 to {len(objectives)}",
        )
    goals = list(dict.fromkeys(goal for objective in objectives for goal in objective))
    occurs = np.array([[goal in objective for goal in goals] for objective in objectives])
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    for _ in range(_DRAWS):
        chosen = np.sort(rng.choice(len(objectives), size=count, replace=False))
        if occurs[chosen].any(axis=0).all():
            return [objectives[index] for index in chosen]
    raise InputError(
        "build_dataset.training_objectives",
        f"none of {_DRAWS} draws of {count} objectives covers all {len(goals)} goals",
        f"a larger number, up to {len(objectives)}",
    )
