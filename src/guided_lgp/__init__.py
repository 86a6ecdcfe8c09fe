"""Guided sequential manipulation planning with a hierarchical policy."""

__version__ = "0.1.0"
