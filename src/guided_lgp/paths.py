"""Where files are: one place for all paths."""

from pathlib import Path

SOURCES = Path(__file__).resolve().parents[2]
"""The clone from which the package is installed (``pip install -e``)."""

MODELS = SOURCES / "models"
"""Trained weights, from Git."""
