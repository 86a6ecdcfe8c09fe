"""The path bound: motions for a whole skeleton."""

from guided_lgp.bounds.path.bound import PathBound

__all__ = ["PathBound"]
