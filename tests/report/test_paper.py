from guided_lgp.experiments import problems
from guided_lgp.report import paper


def test_problems_are_those_of_the_experiments() -> None:
    ours = {problem.name: problem for problem in problems.PROBLEMS}
    assert list(ours)[:7] == [problem.name for problem in paper.PROBLEMS]
    for printed in paper.PROBLEMS:
        problem = ours[printed.name]
        boxes = ["red", "green", "blue", "yellow", "purple"][
            : {"c": 4, "d": 5}.get(problem.setup, 3)
        ]
        assert (printed.k_min, printed.reduced) == (problem.k_min, problem.reduced)
        assert printed.objectives == len(problem.objectives(boxes))


def test_shares_of_table_1_add_up() -> None:
    for subsets in paper.GENERALIZATION.values():
        for figures in subsets.values():
            parts = figures["shortest"] + figures["feasible"] + figures["no_solution"]
            assert abs(parts - 1) < 1e-9


def test_every_problem_has_the_papers_guided_figures() -> None:
    assert set(paper.SCALABILITY) == {problem.name for problem in paper.PROBLEMS}
    stopped = {name for name, row in paper.SCALABILITY.items() if "breadth_first" not in row}
    assert stopped == {"c.2", "d.1", "d.2"}
