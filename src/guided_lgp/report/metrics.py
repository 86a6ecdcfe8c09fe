"""What the files of metrics hold that the report shows; they may hold more."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, TypeAdapter, model_validator

from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.faults import validated
from guided_lgp.paths import METRICS
from guided_lgp.quantities import Count, Figures, Number, Share
from guided_lgp.search.planners import CASE_PLANNERS, TABLE_1, TABLE_3

Metrics = Mapping[str, Any]


class Shares(Figures):
    """Of problems, by outcome."""

    n: Count
    trivial: Share
    shortest: Share
    feasible: Share
    no_solution: Share
    reattempt_infeasible: Share
    reattempt_max_depth: Share
    unsolvable: Share
    shortest_without_path: Share


class Sizes(Figures):
    """What one planner did on one problem; a mean over nothing is None."""

    objectives: Count
    solved: Count
    problems: Annotated[Count, Field(ge=1)]
    problems_solved: Count
    tree_size_mean: Number | None
    tree_size_std: Number | None
    plan_length_mean: Annotated[Number, Field(gt=0)] | None
    policy_calls_mean: Number | None
    coarse_calls_mean: Number | None
    infeasible_calls_mean: Number | None
    failed_candidates_mean: Number | None
    path_calls_mean: Number | None

    @model_validator(mode="after")
    def _means_of_what_was_solved(self) -> "Sizes":
        if (self.plan_length_mean is None) != (self.coarse_calls_mean is None):
            raise ValueError("has means of some figures and not of others")
        return self


class Times(Figures):
    """How long it took (s), and its memory."""

    time_mean_s: Number | None
    time_std_s: Number | None
    symbolic_s: Number | None
    policy_s: Number | None
    coarse_s: Number | None
    path_s: Number | None
    peak_rss_mb: Number


class Fit(Figures):
    """How one sub-policy was trained with one choice of validation samples."""

    accuracy: Share
    loss: Number
    epochs: Count
    best_epoch: Count
    confusion: list[list[Count]]
    curves: dict[
        Literal["training_loss", "training_accuracy", "validation_loss", "validation_accuracy"],
        list[Number],
    ]

    @model_validator(mode="after")
    def _same_lengths(self) -> "Fit":
        if any(len(row) != len(self.confusion) for row in self.confusion):
            raise ValueError("confusion is not square")
        if len(self.curves) != 4 or {len(c) for c in self.curves.values()} != {self.epochs}:
            raise ValueError(f"curves are not four of {self.epochs} epochs")
        return self


class Trained(Fit):
    """The same with its classes, and with whole configurations for validation."""

    classes: list[str]
    by_configuration: Fit


class Training(Figures):
    """The report on the training of one network."""

    samples: Count
    sub_policies: Annotated[dict[str, Trained], Field(min_length=1)]


class Bounds(Figures):
    """Quality and speed of the bounds for one number of actions."""

    n: Count
    coarse_median_ms: Number | None = None
    coarse_first_try: Share | None = None
    false_infeasible: Share | None = None
    infeasible_share: Share | None = None
    path_verified_share: Share | None = None
    path_median_s: Number | None = None
    physics_success_share: Share | None = None


class Draws(Figures):
    """One value per draw."""

    shortest: Annotated[list[Share], Field(min_length=1)]


class CaseFigures(Figures):
    """What one planner did on the problems of one size of a case."""

    scenes: Count
    trainings: Annotated[Count, Field(ge=1)]
    problems: Annotated[Count, Field(ge=1)]
    solved: Count
    solved_within_2k: Count
    solved_min: Count
    calls_mean: Number | None
    calls_limited_mean: Number
    infeasible_calls_mean: Number | None
    failed_candidates_mean: Number | None
    plan_length_mean: Number | None
    path_verified_share: Share | None
    physics_share: Share | None


def _known(rival: str) -> str:
    if rival not in CASE_PLANNERS:
        raise ValueError(f"unknown planner {rival!r}")
    return rival


class CaseRatio(Figures):
    """The policy's calls as a share of the best rival's, with an interval."""

    rival: Annotated[str, AfterValidator(_known)]
    calls: Number
    rival_calls: Annotated[float, Field(gt=0)]
    ratio: Number
    low: Number
    high: Number


_Subset = Literal["all", "unseen"]
_Subsets = Annotated[dict[_Subset, Shares], Field(min_length=2)]

GENERALIZATION = TypeAdapter[Any](Annotated[dict[str, _Subsets], Field(min_length=1)])
SCALABILITY = TypeAdapter[Any](dict[str, dict[str, Sizes]])
TIMING = TypeAdapter[Any](dict[str, dict[str, Times]])
TRAINING = TypeAdapter[Any](Training)
GEOMETRY = TypeAdapter[Any](dict[str, Bounds])
CASES = TypeAdapter[Any](dict[str, dict[str, dict[str, CaseFigures]]])
COMPARED = TypeAdapter[Any](
    dict[str, dict[str, dict[Literal["with_facts", "facts_given"], CaseRatio]]]
)
SPREAD = TypeAdapter[Any](dict[str, dict[str, dict[_Subset, Draws]]])


def read_metrics(path: Path, stage: str, shape: TypeAdapter[Any]) -> Metrics:
    """Read a file of metrics.

    Args:
        path: the file.
        stage: what writes it, for the message.
        shape: what it must hold.

    Raises:
        InputError: the file is missing or damaged, or does not hold that.
    """
    remedy = f"the output of stage {stage}"
    document: Metrics = read_json(path, remedy)
    validated(shape.validate_python, document, str(path), remedy)
    return document


def read_evaluations(root: Path) -> tuple[Metrics, Metrics, Metrics]:
    """The figures of Table I, those of Table III, and the times of the latter.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a file is missing or damaged, or times are of other problems than figures.
    """
    folder, stage = root / METRICS, "compare_scalability"
    figures = read_metrics(folder / "scalability.json", stage, SCALABILITY)
    times = read_metrics(folder / "scalability_timing.json", stage, TIMING)
    shares = read_metrics(folder / "generalization.json", "evaluate_generalization", GENERALIZATION)
    cells, timed = ({name: set(part) for name, part in both.items()} for both in (figures, times))
    planners = set().union(*cells.values()) <= TABLE_3.keys() and shares.keys() <= TABLE_1.keys()
    problems = cells.keys() <= {problem.name for problem in PROBLEMS}
    if not (planners and problems and cells == timed):
        fault = "has problems or planners that are unknown, or not the same in all files"
        raise InputError(str(folder), fault, "the outputs of one run of the pipeline")
    return shares, figures, times
