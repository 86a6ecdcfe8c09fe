"""One plan of a case as a page that the report links."""

import logging
from pathlib import Path

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.cases.declared import declared_case
from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import Params
from guided_lgp.paths import REPORTS
from guided_lgp.view.replay import replay_html

PLANNER = "relational"

logger = logging.getLogger(__name__)


def run(params: Params, root: Path, name: str) -> None:
    """Write ``reports/<case>/replay.html``: of the first training, the plan with most actions.

    Raises:
        InputError: the evaluation is missing, or none of its plans has a path.
    """
    case = declared_case(params, name)
    first = case.params.seeds[0]
    remedy = f"the output of evaluate_case --case {name} --training {first}"
    rows = read_json(root / REPORTS / name / f"{first}.json", remedy)
    plans = [row for row in rows if row["planner"] == PLANNER and row["path_verified"]]
    if not plans:
        raise InputError(f"case {name}", "has no plan with a path", "an evaluation with one")
    plan = max(plans, key=lambda row: (row["length"], row["scene"]))
    drawn = next(one for one in case.problems(plan["size"]) if one.scene.name == plan["scene"])
    skeleton = parse_skeleton(plan["skeleton"])
    path = SceneBounds(drawn.scene, params.bounds).path(skeleton)
    assert path.trajectory is not None
    page = root / REPORTS / name / "replay.html"
    replay_html(path.trajectory, drawn.scene, page, skeleton, drawn.objective)
    logger.info("%s: %s", name, page)
