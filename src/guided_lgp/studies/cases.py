"""The cases of the studies: policies of the pipeline, or others that differ from them in something.

A case is trained once per seed, which draws the training objectives and seeds the training.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from guided_lgp.errors import InputError
from guided_lgp.params import (
    Count,
    Network,
    Params,
    SampleRecipe,
    SearchLimits,
    Section,
    Seed,
    TrainPolicy,
    TrainRelational,
    load_params,
    read_params,
)
from guided_lgp.paths import PARAMS, REPORTS
from guided_lgp.policy.registry import TRAINED_POLICIES
from guided_lgp.search.planners import PAPERS, TABLE_1

STUDIES = Path("studies")
TRAINED = Path("data/studies")
"""Policies: by case, then by seed."""
RESULTS = REPORTS / "studies"

PLANNERS = {key: planner for key, planner in TABLE_1.items() if planner.policy == PAPERS.policy}
"""The searches of Table I, by their keys there; each study brings its own policies."""
OUTCOMES = ("shortest", "feasible", "no_solution")
CLASSIFIER = ("without", "with")
"""The feasibility classifier, in its study."""


def _trained(policy: str) -> str:
    if policy not in TRAINED_POLICIES:
        raise ValueError(f"unknown policy {policy!r} ({', '.join(TRAINED_POLICIES)})")
    return policy


class Case(Section):
    """A policy, by what differs from the paper's."""

    title: str
    policy: Annotated[str, AfterValidator(_trained)]
    """Whose training."""
    patience: Count | None = None
    """Of early stopping, if not the policy's own."""
    dropout: Annotated[float, Field(strict=True, ge=0, lt=1)] | None = None
    """Of all networks, if not their own; of those that have it."""
    recipe: SampleRecipe = SampleRecipe()
    """How samples are made and encoded."""
    configurations: Count | None = None
    """How many training configurations, the first ones, if not all."""
    objectives: Annotated[int, Field(strict=True, ge=1, le=72)] | None = None
    """How many training objectives, if not as many as in the pipeline."""
    split: Literal["random", "configuration"] = "random"
    """How samples for early stopping are chosen."""
    shuffled: Annotated[bool, Field(strict=True)] = False
    """Whether the actions of all samples are exchanged at random."""

    def settings(self, params: Params) -> TrainPolicy | TrainRelational:
        """The training of its policy in the pipeline."""
        section: TrainPolicy | TrainRelational = getattr(
            params, str(TRAINED_POLICIES[self.policy].stage)
        )
        return section

    def drawn_objectives(self, params: Params) -> int:
        """How many training objectives it draws."""
        return self.objectives or params.build_dataset.training_objectives


class FeasibilityStudy(Section):
    """Training of the feasibility classifier."""

    seed: Seed
    validation_share: Annotated[float, Field(gt=0, lt=1)]
    """Share of the configurations that stop the training and calibrate it."""
    patience: Count
    network: Network


class StudyTable(Section):
    """One study: its cases, in order."""

    title: str
    cases: tuple[str, ...]


class StudyParams(Section):
    """The content of ``studies/params.yaml``."""

    seeds: Annotated[tuple[Seed, ...], Field(min_length=1)]
    limits: SearchLimits
    cases: dict[str, Case]
    tables: dict[str, StudyTable]
    feasibility: FeasibilityStudy


def load_study(root: Path) -> tuple[StudyParams, Params]:
    """The parameters of the studies and those of the pipeline.

    Raises:
        InputError: a file is missing or damaged; a table names a case that does not exist, or a
            case wants dropout of a policy without it or more configurations than there are.
    """
    path = root / STUDIES / "params.yaml"
    study, params = read_params(path, StudyParams), load_params(root / PARAMS)
    for table, content in study.tables.items():
        for name in content.cases:
            if name not in study.cases:
                where = f"{path}: tables.{table}.cases"
                raise InputError(where, f"unknown case {name!r}", ", ".join(study.cases))
    for name, case in study.cases.items():
        where, most = f"{path}: cases.{name}", params.generate_scenes.training_configurations
        if case.dropout is not None and not isinstance(case.settings(params), TrainPolicy):
            raise InputError(f"{where}.dropout", "is given", f"none for the {case.policy} policy")
        if case.configurations is not None and case.configurations > most:
            raise InputError(f"{where}.configurations", f"is {case.configurations}", f"1 to {most}")
    return study, params
