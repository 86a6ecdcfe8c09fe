"""The path bound: motions for a whole skeleton."""

from guided_lgp.nlp.path.bound import PathBound

__all__ = ["PathBound"]
