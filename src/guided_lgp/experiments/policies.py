"""The policies that the compared planners follow."""

from collections.abc import Iterable
from pathlib import Path

from guided_lgp.policy.registry import POLICIES, load_policy
from guided_lgp.search.planners import Planner, check_planners
from guided_lgp.search.policy import Policy


def load_policies(planners: Iterable[Planner], directory: Path) -> dict[str, Policy]:
    """The policies of planners, by name, each read once.

    Args:
        planners: rows of the registry.
        directory: the folder ``models``, or one with the same files.

    Raises:
        InputError: a planner names a policy that does not exist, or its files are missing or
            damaged.
    """
    check_planners(POLICIES)
    names = sorted({planner.policy for planner in planners if planner.policy})
    return {name: load_policy(name, directory) for name in names}
