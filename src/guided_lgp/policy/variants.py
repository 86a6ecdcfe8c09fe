"""Named changes of the paper's recipe, for ablations."""

from collections.abc import Mapping

from guided_lgp.params import Variant

VARIANTS: Mapping[str, Variant] = {
    "paper": Variant(),
    "adapted_goals": Variant(adapted_goals=True),
    "any_order_of_boxes": Variant(any_order_of_boxes=True),
    "normalised": Variant(normalised=True),
    "one_order": Variant(both_orders=False),
    "no_chain": Variant(chain=False),
}
