"""Long use leaves nothing behind; `make verify-load` does more of the same."""

from pathlib import Path

from load import GROWTH_MB, many_experiments, many_plans


def test_plans_leave_no_memory_and_no_clients() -> None:
    plans = many_plans(20)
    assert plans.solved == 20
    assert plans.clients == 0
    assert plans.growth_mb < GROWTH_MB


def test_a_database_of_many_experiments_is_opened_and_synced(tmp_path: Path) -> None:
    database = many_experiments(12, tmp_path)
    assert database.runs == 24
    assert database.last_s < 5 * database.first_s
    assert database.sync_s < 30
    assert database.listed_s < 30
