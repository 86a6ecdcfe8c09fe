"""Peak memory of one piece of work."""

import numpy as np

from guided_lgp.experiments.memory import peak_mb, reset_peak


def test_peak_belongs_to_the_work_since_the_reset() -> None:
    block = np.ones(40_000_000)  # 320 MB
    del block
    reset_peak()
    before = peak_mb()
    block = np.ones(20_000_000)  # 160 MB
    assert 140 < peak_mb() - before < 200
    del block
