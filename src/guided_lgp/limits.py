"""How far the search for a user's plan goes."""

import math

from guided_lgp.logic import Objective, Skeleton, least_actions, progress
from guided_lgp.logic.objectives import asks_for_places
from guided_lgp.params import SearchLimits
from guided_lgp.scene import Scene

SEQUENCES_PER_ACTION = 100
"""Sequences that a search may hand to the coarse bound, beyond the limit of the experiments, for
each action that a task needs at least."""


def limits_for(
    limits: SearchLimits,
    scene: Scene,
    goals: Objective,
    prefix: Skeleton,
    max_nodes: int | None,
) -> SearchLimits:
    """Limits that follow the task: those of the experiments, or more where it needs more."""
    state = progress(scene.state, prefix)
    lower_bound = least_actions(state, goals, scene.symbols)
    least = 0 if math.isinf(lower_bound) else int(lower_bound)
    least = max(least, 2) if asks_for_places(goals, scene.symbols) else least
    changed = {
        "max_depth": max(limits.max_depth, len(prefix) + 2 * least),
        "max_sequences": limits.max_sequences + SEQUENCES_PER_ACTION * least,
        "max_tree_size": max_nodes or limits.max_tree_size,
    }
    return limits.model_copy(update=changed)
