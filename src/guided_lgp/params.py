"""The parameters of the pipeline: the model that validates ``params.yaml``."""

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

from guided_lgp.documents import read_yaml
from guided_lgp.errors import InputError
from guided_lgp.faults import words
from guided_lgp.paths import PARAMS, PLANNING


def _no_truth_value(value: object) -> object:
    """Refuse ``true`` for 1.0; ``1e-3``, which YAML 1.1 takes for text, is a number."""
    if isinstance(value, bool):
        raise PydanticCustomError("float_type", "input should be a valid number")
    return value


_NUMBER = BeforeValidator(_no_truth_value)
Count = Annotated[int, Field(strict=True, ge=1, le=10_000_000)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**63)]
Flag = Annotated[bool, Field(strict=True)]


class Section(BaseModel):
    """A part of a file of parameters."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Parameters = TypeVar("Parameters", bound=Section)


class Parallel(Section):
    """Fan-out inside a stage; results do not depend on it."""

    backend: Literal["loky", "dask"]
    workers: Annotated[int, Field(strict=True, ge=1, le=4096)]


class BoundsParams(Section):
    """Limits of the NLP's two bounds."""

    coarse_restarts: Annotated[int, Field(strict=True, ge=1, le=1000)]
    path_solutions: Annotated[int, Field(strict=True, ge=1, le=100)]


class GenerateScenes(Section):
    """Configurations of the setups (paper, Table V)."""

    training_configurations: Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
    test_configurations: Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
    scalability_configurations: Annotated[int, Field(strict=True, ge=1, le=1000)]
    many_boxes_configurations: Annotated[int, Field(strict=True, ge=1, le=1000)]
    seed_training: Seed
    seed_test: Seed
    seed_scalability: Seed


class EnumerateSequences(Section):
    """Exhaustive enumeration of feasible skeletons."""

    max_length: Annotated[int, Field(strict=True, ge=1, le=10)]
    slack: Annotated[int, Field(strict=True, ge=0, le=4)]


class SampleRecipe(Section):
    """How samples are made and encoded; the defaults are the paper's."""

    adapted_goals: Flag = False
    """Where a goal holds already, add samples with the other goal alone, which is what objective
    adaptation asks for in planning; the paper adapts objectives in planning alone."""
    both_orders: Flag = True
    """Duplicate each sample for both orders of its goals."""
    boxes: Literal["declared", "random", "named_first"] = "declared"
    """Which box fills which slot: as declared; for each sequence in an order drawn at random; or
    those that the goals name first, in the order of the goals. Names of boxes mean nothing, and
    with the last two what is learnt about one box holds for all: an unseen objective of two goals
    is then, as a rule, a seen one with other names."""
    relative: Flag = False
    """Take positions relative to the box in the first slot, and that box's relative to the first
    surface."""
    normalised: Flag = False
    """Shift and scale every coordinate to mean 0 and deviation 1 over the training states."""
    symbolic_state: Flag = False
    """Add what the state means to the input: what each box stands on or is held by, and whether
    each encoded goal holds."""
    chain: Flag = True
    """Feed each sub-policy with the decisions before it in its chain."""


class BuildDataset(Section):
    """Draw of the training objectives (paper, Table V)."""

    training_objectives: Annotated[int, Field(strict=True, ge=1, le=72)]
    seed: Seed
    improved: SampleRecipe
    """What the improved networks are trained on."""


class Network(Section):
    """Architecture and optimiser of one network (paper, Table IV)."""

    layers: Annotated[int, Field(strict=True, ge=1, le=20)]
    nodes: Annotated[int, Field(strict=True, ge=1, le=4096)]
    dropout: Annotated[float, Field(ge=0, lt=1), _NUMBER]
    l2: Annotated[float, Field(ge=0, le=1), _NUMBER]
    epochs: Annotated[int, Field(strict=True, ge=1, le=100_000)]
    batch: Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
    lr: Annotated[float, Field(gt=0, le=1), _NUMBER]


class TrainPolicy(Section):
    """Training of the networks of a hierarchical policy (paper, Table IV).

    The key of each network is its name: ``instruction``, and the instructions of the domain.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Network] = Field(init=False)

    seed: Seed
    validation_share: Annotated[float, Field(gt=0, lt=1), _NUMBER]
    patience: Count

    @property
    def networks(self) -> dict[str, Network]:
        """Architecture and optimiser of each network."""
        return self.__pydantic_extra__

    def with_dropout(self, dropout: float) -> "TrainPolicy":
        """The same with another dropout in all networks."""
        networks = {
            name: network.model_copy(update={"dropout": dropout})
            for name, network in self.networks.items()
        }
        return TrainPolicy.model_validate(self.model_dump() | networks)


class TrainRelational(Section):
    """Training of the relational policy."""

    seed: Seed
    validation_share: Annotated[float, Field(gt=0, lt=1), _NUMBER]
    patience: Count
    width: Annotated[int, Field(strict=True, ge=1, le=1024)]
    rounds: Annotated[int, Field(strict=True, ge=1, le=20)]
    l2: Annotated[float, Field(ge=0, le=1), _NUMBER]
    epochs: Annotated[int, Field(strict=True, ge=1, le=100_000)]
    batch: Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
    lr: Annotated[float, Field(gt=0, le=1), _NUMBER]


class SearchLimits(Section):
    """Limits of a search: depth and reattempts of the guided one, nodes and sequences of any."""

    max_depth: Annotated[int, Field(strict=True, ge=1, le=100)]
    reattempts: Annotated[int, Field(strict=True, ge=0, le=1000)]
    max_tree_size: Count
    max_paths: Annotated[int, Field(strict=True, ge=1, le=10_000)]
    """Sequences handed to the path bound."""
    max_sequences: Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
    """Sequences handed to the coarse bound: minutes at 20 actions, where a search could otherwise
    take a day."""


class PlanningParams(Section):
    """What planning one task needs; the parameters of the stages may stand in the same file."""

    bounds: BoundsParams
    compare_scalability: SearchLimits


class Demonstrations(Section):
    """The training set of a case."""

    family: str
    """That of the test set, or another one with the same numbers."""
    size: Annotated[int, Field(strict=True, ge=1, le=15)]
    """Boxes per scene."""
    scenes: Annotated[int, Field(strict=True, ge=2, le=100_000)]
    seed: Seed


class Evaluation(Section):
    """The test set of a case."""

    sizes: Annotated[
        tuple[Annotated[int, Field(strict=True, ge=1, le=15)], ...], Field(min_length=1)
    ]
    """Boxes per scene."""
    scenes: Annotated[int, Field(strict=True, ge=1, le=10_000)]
    """For each size."""
    seed: Seed
    paths: Annotated[int, Field(strict=True, ge=0, le=10_000)]
    """Plans per size and planner of the first training that get a path and are carried out."""


class Case(Section):
    """A family of problems where geometry decides: policies of its own, and its rivals."""

    title: str
    domain: str
    robot: str
    family: str
    """Of the test set."""
    layout: dict[str, Any] = {}
    """What differs from the families' usual numbers."""
    demonstrations: Demonstrations
    training: TrainRelational
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1)]
    """One training each."""
    controls: tuple[str, ...] = ()
    """Further policies, with less to see or with shuffled labels, trained with the first seed."""
    evaluation: Evaluation
    limits: SearchLimits


class Params(PlanningParams):
    """All parameters; top keys are stage names, but for ``cases``."""

    parallel: Parallel
    generate_scenes: GenerateScenes
    enumerate_sequences: EnumerateSequences
    build_dataset: BuildDataset
    train_policy: TrainPolicy
    train_improved: TrainPolicy
    train_relational: TrainRelational
    evaluate_generalization: SearchLimits
    cases: dict[str, Case] = {}


def load_params(path: Path = PARAMS) -> Params:
    """Read and check the parameters of the pipeline; see :func:`read_params`."""
    return read_params(path, Params)


def load_planning(path: Path = PLANNING) -> PlanningParams:
    """Read and check the parameters of planning: the shipped ones, or those of a pipeline.

    Raises:
        InputError: see :func:`read_params`.
    """
    document = read_yaml(path)
    whole = isinstance(document, dict) and not document.keys() <= PlanningParams.model_fields.keys()
    return _validated(path, document, Params if whole else PlanningParams)


def read_params(path: Path, model: type[Parameters]) -> Parameters:
    """Read and check a file of parameters.

    Args:
        path: the file.
        model: what it shall hold.

    Raises:
        InputError: the file is missing, is not YAML, has an unknown key, a wrong type or an
            impossible value; the message names the key and what is accepted.
    """
    return _validated(path, read_yaml(path, f"{path.name} of a clone, in its folder"), model)


def _validated(path: Path, document: Any, model: type[Parameters]) -> Parameters:
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise _input_error(path, error, model) from None


def _input_error(path: Path, error: ValidationError, model: type[BaseModel]) -> InputError:
    first = error.errors()[0]
    keys = [str(part) for part in first["loc"]]
    where = f"{path}: {'.'.join(keys)}" if keys else str(path)
    match first["type"]:
        case "extra_forbidden":
            return InputError(where, "unknown key", ", ".join(_accepted_keys(model, keys[:-1])))
        case "missing":
            return InputError(where, "missing")
        case "model_type":
            return InputError(where, "is not a mapping", ", ".join(_accepted_keys(model, keys)))
    return InputError(where, words(first))


def _accepted_keys(model: type[BaseModel], section: list[str]) -> list[str]:
    kind: Any = model
    for key in section:
        # a mapping of names of one's own to sections, or a section with fields, or with both
        if get_origin(kind) is not dict and key in kind.model_fields:
            kind = kind.model_fields[key].annotation
        else:
            own = kind if get_origin(kind) is dict else kind.__annotations__["__pydantic_extra__"]
            kind = get_args(own)[1]
    return list(getattr(kind, "model_fields", ()))
