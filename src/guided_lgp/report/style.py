"""Names and colours that tables, figures and pages share."""

from guided_lgp.domains import load_domain
from guided_lgp.policy import registry
from guided_lgp.search.planners import Planner

POLICIES = {name: declared.label for name, declared in registry.POLICIES.items()}
"""The policies, in the order of every table."""

POLICY_COLORS = {name: declared.color for name, declared in registry.POLICIES.items()}


def planner_style(planner: Planner) -> dict[str, str]:
    """How a planner is drawn: a colour per policy, dashed where the search is greedy."""
    color = planner.color or POLICY_COLORS[planner.policy]
    return {"color": color, "marker": planner.marker, "linestyle": planner.linestyle}


NETWORKS = {"instruction": "μ_ins"} | {
    instruction.name: f"μ_{instruction.name}" for instruction in load_domain().instructions
}
"""The networks of the paper's hierarchical policy."""
