"""Planners: one row each in :mod:`guided_lgp.search.planners`, all on the same two bounds.

A search is a function ``plan(problem: Problem) -> SearchResult``.
"""
