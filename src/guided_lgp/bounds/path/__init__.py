"""The path bound: motions for a whole skeleton."""

from guided_lgp.bounds.path.bound import PAPER, PathBound, Style
from guided_lgp.bounds.path.steps import check_motions

__all__ = ["PAPER", "PathBound", "Style", "check_motions"]
