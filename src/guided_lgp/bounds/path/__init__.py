"""The path bound: motions for a whole skeleton."""

from guided_lgp.bounds.path.bound import PathBound, Shorten
from guided_lgp.bounds.path.steps import check_motions

__all__ = ["PathBound", "Shorten", "check_motions"]
