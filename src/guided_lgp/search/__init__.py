"""Planners: one module each, all on the same two bounds and, where guided, the same policy.

Every planner is a function ``plan(scene, objective, symbols, bounds, ..., limits)`` that returns a
:class:`SearchResult`.
"""

from guided_lgp.search.result import SearchResult

__all__ = ["SearchResult"]
