"""The tables of peers in ``docs/benchmarks.md``: KOMO's keyframes, and VAMP's published figures."""

from guided_lgp.report.cells import number
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.table import Table

_ASKED = ("komo", "ours")
_COUNTS = ("n", "komo_first_start", "komo", "ours", "only_komo", "only_ours")
_TIMES = ("komo_scene_ms", "komo_ms", "ours_scene_ms", "ours_ms", "ours_last_action_ms")


def peer_tables(metrics: Metrics) -> tuple[Table, Table]:
    """KOMO beside the coarse bound, and checks beside VAMP, from the part ``peers``."""
    return _komo(metrics), _checks(metrics)


def _komo(metrics: Metrics) -> Table:
    measured = [
        (family, length, row)
        for family, lengths in metrics["komo"].items()
        for length, row in lengths.items()
    ]
    largest = max(row["komo_errors_max"] for *_, row in measured)
    return Table(
        "komo",
        "Coarse bound, and KOMO's keyframes of the same skeletons in the same scenes",
        (
            *("Tables", "K", "n", "first start", "within 12"),
            *("coarse bound", "KOMO alone", "coarse bound alone"),
            *("scene", "skeleton", "scene", "skeleton", "last action"),
        ),
        tuple(
            (
                family,
                length,
                *(str(row[name]) for name in _COUNTS),
                *(number(row[name]) for name in _TIMES),
            )
            for family, length, row in measured
        ),
        (
            "CPU time, one thread each, medians of what both solve. A Panda, three boxes of "
            "12 × 6 × 8 cm and two tables: near ones, those of make reach, or far ones; grasps "
            "and places in turn, drawn at random. KOMO is that of the package robotic 0.4.2, with "
            "the frames, constraints and solver options of its tutorial on manipulation. Scene: "
            "what is made once for all skeletons of a scene, by KOMO a robot from its file, by the "
            "coarse bound geometry, worlds and facts of reach. Skeleton: all its actions, KOMO's "
            "in one program that starts from the robot's posture and knows no prefix, the coarse "
            "bound's one after the other. Last action: the prefix is known, as in a search. "
            f"{_both(*measured[0])} {_unsolved(metrics['unsolved'])}",
            "What differs: KOMO calls a point feasible if its scaled errors, equations and "
            "inequalities apart, each sum to less than 0.1, which is 1 cm of one position; the "
            f"largest sum of both here is {number(largest, 3)}. Collisions are one such equation, "
            "of capsules for the Panda, 14 cm wide about the palm. It also shortens the way of the "
            "joints, keeps joint 6 within 0.5–3 rad and the grasp 2 cm from the box's edges, and "
            "nothing else verifies its keyframes. The coarse bound stops at a feasible point; "
            "PyBullet has verified it, which its time includes.",
        ),
        (
            *(("", 3), ("KOMO solves", 2), ("Solved by", 3)),
            *(("KOMO (ms)", 2), ("Coarse bound (ms)", 3)),
        ),
        labels=2,
    )


def _both(family: str, length: str, row: Metrics) -> str:
    """What one skeleton in a new scene takes."""
    komo, ours = (number(row[f"{name}_scene_ms"] + row[f"{name}_ms"], 0) for name in _ASKED)
    return (
        f"Scene and one skeleton of {length} actions ({family}): {komo} ms by KOMO, {ours} ms by "
        "the coarse bound."
    )


def _unsolved(metrics: Metrics) -> str:
    """What "no" takes either of them."""
    komo, ours = (
        f"{metrics[f'{name}_n']} ({number(metrics[f'{name}_ms'], 0)} ms in the median)"
        for name in _ASKED
    )
    return f"Not solved: {komo} by KOMO, {ours} by the coarse bound."


def _checks(metrics: Metrics) -> Table:
    check = 1e6 / metrics["checks_per_s"]
    measured = (
        (
            "here: a check of a random configuration of the Panda, three boxes, two tables",
            f"{number(check, 2)} µs",
            "measured",
        ),
        (
            "here: path bound of an action of the Panda, verified and timed, median",
            f"{number(metrics['path_ms_per_action'])} ms",
            "measured",
        ),
    )
    quoted = tuple((row["what"], row["figure"], row["source"]) for row in metrics["published"])
    return Table(
        "checks",
        "Checks of configurations, beside published figures",
        ("What", "time", "from"),
        (*quoted, *measured),
        (
            "VAMP is not run here: its build downloads sources. Other processors, other scenes: "
            "only orders of magnitude compare. VAMP checks spheres that enclose the robot; a check "
            "here certifies that hulls of its meshes have 3 mm to spare, and leaves to coal what "
            "it cannot. A problem of VAMP is one motion without contact; an action here has "
            "several, with contacts, straight retreats, a time law, limits of motors and "
            "verification.",
        ),
        labels=1,
    )
