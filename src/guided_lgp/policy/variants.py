"""Named changes of the paper's recipe, for ablations and for what improves it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Variant:
    """How samples are made and encoded; the defaults are the paper's."""

    unsatisfied_goals: bool = False
    """Encode only the goals that do not hold yet in the samples, as objective adaptation does when
    planning; the paper adapts objectives in planning alone."""
    both_orders: bool = True
    """Duplicate each sample for both orders of its goals."""
    normalised: bool = False
    """Shift and scale every coordinate to mean 0 and deviation 1 over the training states."""
    chain: bool = True
    """Feed each sub-policy with the decisions before it in its chain."""


VARIANTS: Mapping[str, Variant] = {
    "paper": Variant(),
    "improved": Variant(unsatisfied_goals=True, normalised=True),
    "unsatisfied_goals": Variant(unsatisfied_goals=True),
    "normalised": Variant(normalised=True),
    "one_order": Variant(both_orders=False),
    "no_chain": Variant(chain=False),
}
