"""The coarse bound: one configuration per action."""

from guided_lgp.bounds.coarse.bound import CoarseBound

__all__ = ["CoarseBound"]
