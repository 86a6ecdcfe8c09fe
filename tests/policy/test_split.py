import pytest

from guided_lgp.errors import InputError
from guided_lgp.logic import Symbols, one_goal_objectives, two_goal_objectives
from guided_lgp.policy.split import training_objectives


def test_forty_of_the_two_goal_objectives_and_every_goal_occurs(symbols: Symbols) -> None:
    for seed in range(20):
        drawn = training_objectives(symbols, 40, seed)
        assert len(drawn) == len(set(drawn)) == 40
        assert set(drawn) < set(two_goal_objectives(symbols))
        for (goal,) in one_goal_objectives(symbols):
            assert any(goal in objective for objective in drawn)


def test_the_seed_decides_about_the_draw(symbols: Symbols) -> None:
    assert training_objectives(symbols, 40, 4) == training_objectives(symbols, 40, 4)
    assert training_objectives(symbols, 40, 4) != training_objectives(symbols, 40, 5)


def test_unseen_are_the_other_thirty_two_and_all_one_goal_objectives(symbols: Symbols) -> None:
    drawn = training_objectives(symbols, 40, 4)
    tested = one_goal_objectives(symbols) + two_goal_objectives(symbols)
    assert len([objective for objective in tested if objective not in drawn]) == 32 + 15


@pytest.mark.parametrize("count", [0, 7, 73])
def test_a_number_that_cannot_cover_the_goals_is_refused(symbols: Symbols, count: int) -> None:
    with pytest.raises(InputError, match=rf"training_objectives: .*{count}"):
        training_objectives(symbols, count, 4)
