"""One plan of a case as a page that the report links."""

import logging
from pathlib import Path

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.cases.declared import declared_case
from guided_lgp.cases.outcomes import outcomes_of, read_outcomes
from guided_lgp.errors import InputError
from guided_lgp.logic import Skeleton, parse_skeleton
from guided_lgp.params import Params
from guided_lgp.paths import REPORTS
from guided_lgp.scene.families import Drawn
from guided_lgp.search.given import read_skeleton
from guided_lgp.view.replay import replay_html

PLANNER = "relational"

logger = logging.getLogger(__name__)


def run(params: Params, root: Path, name: str) -> None:
    """Write ``reports/<case>/replay.html``: of the first training, the plan with most actions.

    Raises:
        InputError: see :func:`longest_plan`; or that plan has no path.
    """
    drawn, skeleton = longest_plan(params, root, name)
    path = SceneBounds(drawn.scene, params.bounds).path(skeleton)
    if path.trajectory is None:
        raise InputError(f"case {name}", "has no path for its longest plan", "its evaluation anew")
    page = root / REPORTS / name / "replay.html"
    replay_html(path.trajectory, drawn.scene, page, skeleton, drawn.objective)
    logger.info("%s: %s", name, page)


def longest_plan(params: Params, root: Path, name: str) -> tuple[Drawn, Skeleton]:
    """Of the first training, the problem whose plan with a path has most actions, and that plan.

    Raises:
        InputError: the evaluation is missing or damaged, is of other problems than the case, or
            none of its plans has a path.
    """
    case = declared_case(params, name)
    first = case.params.seeds[0]
    rows = read_outcomes(root, name, first)
    plans = [row for row in rows if row["planner"] == PLANNER and row["path_verified"]]
    if not plans:
        raise InputError(f"case {name}", "has no plan with a path", "an evaluation with one")
    plan = max(plans, key=lambda row: (row["length"], row["scene"]))
    known = case.problems(plan["size"]) if plan["size"] in case.params.evaluation.sizes else []
    drawn = next((one for one in known if one.scene.name == plan["scene"]), None)
    if drawn is None:
        where = str(outcomes_of(root, name, first))
        raise InputError(where, f"has an unknown scene {plan['scene']!r}", "the case's own scenes")
    symbols, start = drawn.scene.symbols, drawn.scene.state
    return drawn, read_skeleton(parse_skeleton(plan["skeleton"]), symbols, start)
