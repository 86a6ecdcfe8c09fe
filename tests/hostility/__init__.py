"""The parts of `make verify-hostile`: what is tried, and who judges what came of it."""

import sys
from pathlib import Path

_TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(_TESTS / part) for part in ("report", "robots")]  # where made-up files are made
