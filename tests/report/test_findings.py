from typing import Any

from guided_lgp.report import findings


def cell(size: float | None, solved: int = 12) -> dict[str, Any]:
    return {"problems": 12, "problems_solved": solved, "tree_size_mean": size}


def times(total: float | None) -> dict[str, Any]:
    return {"time_mean_s": total, "symbolic_s": total, "policy_s": 0.0, "coarse_s": 0.0}


def sentences(sizes: dict[str, Any], seconds: dict[str, Any]) -> list[str]:
    return findings.scalability({"c.1": sizes}, {"c.1": seconds})


def test_a_rival_that_beats_guided_search_is_named() -> None:
    text = sentences(
        {"guided": cell(99.0), "astar": cell(40.0), "breadth_first_graph": cell(5000.0)},
        {"guided": times(0.5), "astar": times(2.0), "breadth_first_graph": times(0.4)},
    )
    assert (
        "What generates fewer nodes than guided search: "
        "A* (than Guided on c.1, than every guided planner on c.1)." in text
    )
    assert (
        "What needs less time without the path bound than guided search: "
        "Graph breadth-first (than Guided on c.1, than every guided planner on c.1)." in text
    )


def test_a_rival_may_beat_one_guided_planner_and_not_another() -> None:
    text = sentences(
        {"guided": cell(99.0), "relational": cell(30.0), "astar": cell(40.0)},
        {"guided": times(0.5), "relational": times(0.5), "astar": times(2.0)},
    )
    assert "What generates fewer nodes than guided search: A* (than Guided on c.1)." in text


def test_without_such_a_rival_the_text_says_so() -> None:
    text = sentences(
        {"guided": cell(99.0), "astar": cell(400.0)}, {"guided": times(0.5), "astar": times(2.0)}
    )
    assert sum("No rival" in sentence for sentence in text) == 2


def test_a_rival_that_leaves_problems_unsolved_does_not_win() -> None:
    text = sentences(
        {"guided": cell(99.0), "astar": cell(40.0, solved=11)},
        {"guided": times(0.5), "astar": times(0.1)},
    )
    assert not any("A*" in sentence for sentence in text)


def test_problems_without_a_plan_are_counted() -> None:
    text = sentences(
        {"guided": cell(99.0, solved=10), "guided_best_first": cell(99.0)},
        {"guided": times(0.5), "guided_best_first": times(0.5)},
    )
    assert "Not all the paper's problems: Guided solves 10 of 12 on c.1." in text
    assert (
        "All the paper's problems are solved, with a verified path, by Guided best-first." in text
    )


def test_breadth_first_is_compared_or_said_to_have_met_the_limit() -> None:
    guided = {"guided": cell(100.0)}
    text = sentences(
        guided | {"breadth_first": cell(200_000.0)},
        {"guided": times(0.5), "breadth_first": times(50.0)},
    )
    assert "The breadth-first tree is larger than the guided one by 2,000× on c.1." in text
    assert any("faster than breadth-first by 100.0× on c.1" in sentence for sentence in text)
    text = sentences(
        guided | {"breadth_first": cell(None, solved=3)},
        {"guided": times(0.5), "breadth_first": times(None)},
    )
    assert "Breadth-first was stopped at a limit on c.1 (3 of 12 solved)." in text


def test_an_aim_missed_is_said() -> None:
    sizes = {"guided": cell(100.0), "breadth_first": cell(200_000.0)}
    slow = sentences(sizes, {"guided": times(0.5), "breadth_first": times(10.0)})
    assert any("aim of 50× in time on c.1 is not reached" in sentence for sentence in slow)
    fast = sentences(sizes, {"guided": times(0.5), "breadth_first": times(50.0)})
    assert not any("is not reached" in sentence for sentence in fast)


def test_figures_worse_than_the_papers_are_said() -> None:
    text = sentences({"guided": cell(189.2)}, {"guided": times(0.5)})
    assert (
        "Greedy search with the paper's networks generates more nodes than the paper's on "
        "c.1 (189.2 against 101.0)." in text
    )
    shares = {"shortest": 0.8, "no_solution": 0.0}
    (ours, missed) = findings.generalization({"default": {"all": shares, "unseen": shares}}, {})
    assert ours.startswith("Paper's networks: shortest solutions, all / unseen objectives: 80.0%")
    assert "default, all: 80.0% against 91.9%" in missed


def test_many_boxes_name_the_effort_of_the_relational_policy() -> None:
    text = findings.scalability(
        {
            "e.10": {
                "relational": cell(400.0) | {"policy_calls_mean": 20.5},
                "astar": cell(None, solved=2),
            }
        },
        {"e.10": {"relational": times(0.6), "astar": times(None)}},
    )
    assert (
        "On e.10 (K = 20), of 12 problems, Relational solves 12, A* solves 2. Relational takes "
        "20.5 policy calls and 0.60 s on average without the path bound." in text
    )
