"""Named changes of the paper's recipe, for ablations and for what improves it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Variant:
    """How samples are made and encoded; the defaults are the paper's."""

    adapted_goals: bool = False
    """Where a goal holds already, add samples with the other goal alone, which is what objective
    adaptation asks for in planning; the paper adapts objectives in planning alone."""
    both_orders: bool = True
    """Duplicate each sample for both orders of its goals."""
    any_order_of_boxes: bool = False
    """Let the boxes of each sequence fill the slots in an order drawn at random. Their names mean
    nothing, so that what is learnt about one box holds for all; note that an unseen objective may
    then be a seen one with other names."""
    normalised: bool = False
    """Shift and scale every coordinate to mean 0 and deviation 1 over the training states."""
    chain: bool = True
    """Feed each sub-policy with the decisions before it in its chain."""


VARIANTS: Mapping[str, Variant] = {
    "paper": Variant(),
    "improved": Variant(adapted_goals=True, any_order_of_boxes=True, normalised=True),
    "adapted_goals": Variant(adapted_goals=True),
    "any_order_of_boxes": Variant(any_order_of_boxes=True),
    "normalised": Variant(normalised=True),
    "one_order": Variant(both_orders=False),
    "no_chain": Variant(chain=False),
}
