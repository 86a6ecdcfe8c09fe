"""Where files are: one place for all paths."""

from pathlib import Path

SOURCES = Path(__file__).resolve().parents[2]
"""The clone from which the package is installed (``pip install -e``)."""

SHIPPED = Path(__file__).with_name("shipped")
"""What comes with the package: trained weights, limits, example scenes, descriptions of robots."""

MODELS = SHIPPED / "models"
"""The shipped weights: a copy of the pipeline's, which ``make ship`` takes."""

PLANNING = SHIPPED / "planning.yaml"
"""The shipped limits of planning."""

EXAMPLES = SHIPPED / "examples"
"""Example scenes."""

DESCRIPTIONS = SHIPPED / "robots"
"""URDF, SRDF and meshes of robots, a folder each."""

# What the stages read and write, relative to the folder of dvc.yaml.
PIPELINE = Path("dvc.yaml")
CASES = Path("cases/dvc.yaml")
PARAMS = Path("params.yaml")
SCENES = Path("data/scenes")
SEQUENCES = Path("data/sequences")
DATASET = Path("data/dataset")
EVALUATION = Path("data/evaluation")
TRAINED = Path("models")
REPORTS = Path("reports")
METRICS = REPORTS / "metrics"
TRAINING = REPORTS / "training"
