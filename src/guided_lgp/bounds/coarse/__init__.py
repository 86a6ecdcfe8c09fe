"""The coarse bound: one configuration per action."""

from guided_lgp.bounds.coarse.bound import CoarseBound
from guided_lgp.bounds.coarse.formulation import check_terms

__all__ = ["CoarseBound", "check_terms"]
