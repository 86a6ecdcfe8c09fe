"""Where files are: one place for all paths."""

from pathlib import Path

SOURCES = Path(__file__).resolve().parents[2]
"""The clone from which the package is installed (``pip install -e``)."""

MODELS = SOURCES / "models"
"""Trained weights, from Git."""

# What the stages read and write, relative to the folder of dvc.yaml.
PARAMS = Path("params.yaml")
SCENES = Path("data/scenes")
SEQUENCES = Path("data/sequences")
DATASET = Path("data/dataset")
EVALUATION = Path("data/evaluation")
TRAINED = Path("models")
REPORTS = Path("reports")
METRICS = REPORTS / "metrics"
TRAINING = REPORTS / "training"
