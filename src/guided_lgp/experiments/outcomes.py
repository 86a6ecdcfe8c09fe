"""The tables of the evaluations: their columns."""

import pyarrow as pa

OUTCOMES = ("shortest", "feasible", "no_solution")

BOUND_COUNTS = ("coarse_calls", "infeasible_calls", "failed_candidates")
"""What a search asks of the coarse bound, how much of that it refuses, and the plans refused."""

GENERALIZATION = pa.schema(
    [
        ("configuration", pa.string()),
        ("objective", pa.string()),
        ("unseen", pa.bool_()),
        ("planner", pa.string()),
        ("outcome", pa.string()),
        ("skeleton", pa.string()),
        ("length", pa.int32()),
        ("shortest_length", pa.int32()),
        ("shortest_has_path", pa.bool_()),
        ("reattempts_infeasible", pa.int32()),
        ("reattempts_max_depth", pa.int32()),
        ("tree_size", pa.int32()),
        ("expansions", pa.int32()),
        ("policy_calls", pa.int32()),
        ("coarse_calls", pa.int32()),
        ("infeasible_calls", pa.int32()),
        ("failed_candidates", pa.int32()),
        ("path_calls", pa.int32()),
        ("reason", pa.string()),
    ]
)
"""``outcome``: trivial, or one of :data:`OUTCOMES`; ``shortest_has_path``: whether any sequence of
the shortest length has a path, null if there is no such sequence."""

SCALABILITY = pa.schema(
    [
        ("problem", pa.string()),
        ("configuration", pa.string()),
        ("objective", pa.string()),
        ("planner", pa.string()),
        ("solved", pa.bool_()),
        ("reason", pa.string()),
        ("skeleton", pa.string()),
        ("length", pa.int32()),
        ("tree_size", pa.int32()),
        ("expansions", pa.int32()),
        ("policy_calls", pa.int32()),
        ("coarse_calls", pa.int32()),
        ("infeasible_calls", pa.int32()),
        ("failed_candidates", pa.int32()),
        ("path_calls", pa.int32()),
        ("reattempts_infeasible", pa.int32()),
        ("reattempts_max_depth", pa.int32()),
    ]
)
