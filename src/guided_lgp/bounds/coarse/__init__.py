"""The coarse bound: one configuration per action (DESIGN §4)."""

from guided_lgp.bounds.coarse.bound import CoarseBound

__all__ = ["CoarseBound"]
