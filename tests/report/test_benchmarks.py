from pathlib import Path

from guided_lgp.documents import read_json
from guided_lgp.paths import METRICS
from guided_lgp.report.benchmarks import PAGE, benchmark_page

ROOT = Path(__file__).parents[2]

MACHINE = {
    "cpu": "A CPU",
    "cores": 2,
    "memory_gb": 8.0,
    "system": "Linux 6",
    "python": "3.11.9",
    "packages": {"casadi": "3.7"},
}


def cell(seconds: float | None, solved: int = 6) -> dict[str, float | int | None]:
    times = dict.fromkeys(("symbolic_s", "policy_s", "coarse_s"), seconds)
    return {"problems": 6, "problems_solved": solved} | times


def test_peers_are_told_beside_ours() -> None:
    times = ("komo_scene", "komo", "ours_scene", "ours", "ours_last_action")
    row = {f"{name}_ms": 10.0 * place for place, name in enumerate(times, start=1)}
    row |= {"n": 40, "komo_first_start": 38, "komo": 39, "ours": 37, "komo_errors_max": 0.0123}
    row |= {"only_komo": 2, "only_ours": 0}
    metrics = {
        "komo": {"near": {"2": row, "4": row | {"komo_errors_max": 0.0456}}},
        "unsolved": {"komo_n": 2, "komo_ms": 1_234.4, "ours_n": 0, "ours_ms": None},
        "checks_per_s": 2e6,
        "path_ms_per_action": 23.45,
        "published": [{"what": "Theirs", "figure": "35 µs", "source": "Their paper"}],
    }
    lines = benchmark_page({"machine": MACHINE, "peers": metrics}).splitlines()
    figures = "40 | 38 | 39 | 37 | 2 | 0 | 10.0 | 20.0 | 30.0 | 40.0 | 50.0 |"
    assert {f"| near | {length} | {figures}" for length in (2, 4)} <= set(lines)
    note = next(line for line in lines if line.startswith("CPU time"))
    assert "(near): 30 ms by KOMO, 70 ms by the coarse bound." in note
    assert "Not solved: 2 (1,234 ms in the median) by KOMO, 0 (– ms in the median) by" in note
    assert any("largest sum of both here is 0.046." in line for line in lines)
    assert "| Theirs | 35 µs | Their paper |" in lines
    assert any(line.startswith("| here: a check") and "| 0.50 µs |" in line for line in lines)
    assert any("| 23.4 ms |" in line for line in lines)


def test_every_part_has_a_table_and_ratios_come_from_one_run() -> None:
    ipopt = {
        "n": 30,
        "solver_median_ms": 1.5,
        "ipopt_feasible_median_ms": 30.0,
        "ipopt_optimum_median_ms": 45.0,
        "times_faster_than_ipopt_feasible": 20.0,
        "times_faster_than_ipopt_optimum": 30.0,
    }
    coarse = {"n": 100, "coarse_median_ms": 1.0, "coarse_first_try": 0.8, "false_infeasible": 0.01}
    motion = {"n": 100, "path_verified_share": 0.99, "path_median_s": 0.4, "path_max_s": 3.0}
    planners = {
        "breadth_first": cell(None, solved=0),
        "breadth_first_graph": cell(0.5),
        "astar": cell(0.1, solved=5),
        "guided_best_first": cell(0.2),
        "relational": cell(0.05),
    }
    twice = {"n": 5, "old_median_ms": 20.0, "new_median_ms": 10.0, "ratio": 2.0}
    unchanged = {"changed_to_feasible": 3, "changed_to_infeasible": 0}
    kinds = ("feasible", "infeasible", "infeasible_without_fact")
    sizes = ("variables", "rows")
    against = {
        "baseline": "50577ca",
        "load": 0.4,
        "coarse_bound": dict.fromkeys(kinds, twice)
        | unchanged
        | {"refused_now": {"joint limit": 2}},
        "coarse_step": twice | {f"{v}_{n}": 900 for v in ("old", "new") for n in sizes},
        "enumeration": twice,
        "path_bound": {"2": twice | unchanged, "10": {"n": 0} | unchanged},
        "plan_process": {"3": twice},
        "plan_process_uncoordinated": {"3": twice},
    }
    page = benchmark_page(
        {
            "machine": MACHINE,
            "against": against,
            "limits": {
                "checks": {"per_s": 2e6, "at_operations_per_s": 8e6, "at_memory_per_s": 4e7},
                "coarse_feasible": {"n": 80, "median_ms": 2.0, "floor_ms": 0.5},
            },
            "minutes": {"repro": 12.34, "test": 7.0, "load_before": 0.1},
            "false_infeasible": {
                "n": 600,
                "found": 3,
                "witnesses": [],
                "feasible": 500,
                "feasible_found": 490,
            },
            "coarse_bound": {"4": coarse | {"ipopt": ipopt}},
            "path_bound": {"4": motion | {"physics_success_share": 0.98, "physics_n": 30}},
            "enumeration": {"1": 80.0, "2": 150.0},
            "planners": {"c.1": planners},
            "training": {"instruction": 123_456.0},
            "memory": {"generate_scenes": 210.0},
        }
    )
    assert "A CPU, 2 cores, 8.0 GB" in page
    assert page.count("\n**") == 10
    lines = page.splitlines()
    assert "| path bound, K = 2 | 20.0 | 10.0 | 2.0× | 5 |" in lines
    assert "| guided-lgp plan --no-coordinate, K = 3 | 20.0 | 10.0 | 2.0× | 5 |" in lines
    assert "| 12.3 | 7.0 | 0.1 |" in lines
    assert "| feasible coarse verdict | 2.00 ms | 0.50 ms | its compiled code | 25.0% |" in lines
    assert "| 600 | 3 | 0.5% | 490 of 500 |" in lines
    assert not any("K = 10" in line for line in lines)
    assert "Verdicts that changed: 9 from infeasible to feasible, 0 from" in page
    row = next(line for line in lines if line.startswith(r"| c.1\*"))
    assert [text.strip() for text in row.strip("|").split("|")] == [
        *(r"c.1\*", "8", "0.600", "0.150"),
        *("– (0/6)", "– (0/6)", "2.5×", "10.0×", "0.5× (5/6)", "2.0× (5/6)"),
    ]
    assert any(line.startswith("| 2 | 150 | 1.88×") for line in lines)
    assert any(line.startswith("| 4 | 1.00 | 80.0% | 1.0% | 1.50 | 30.0") for line in lines)


def test_the_page_in_the_docs_is_what_the_figures_render_to() -> None:
    figures, page = ROOT / METRICS / "benchmark.json", ROOT / PAGE
    assert figures.exists() == page.exists()
    if figures.exists():
        document = read_json(figures, "make bench")
        assert page.read_text(encoding="utf-8") == benchmark_page(document)
