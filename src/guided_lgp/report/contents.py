"""The report's sections: which table and which figure stands where, and what is said about it."""

from collections.abc import Iterator, Mapping, Sequence

from guided_lgp.params import Params
from guided_lgp.policy.registry import TRAINED_POLICIES
from guided_lgp.report import cases, findings
from guided_lgp.report.document import (
    Answers,
    Block,
    Bullets,
    Document,
    Folded,
    Gallery,
    Links,
    Picture,
    Section,
)
from guided_lgp.report.inputs import Inputs
from guided_lgp.report.table import Table

COMMAND = "dvc repro"

DIFFERENCES = (
    "The robot's base and torso are fixed, so that reach decides about feasibility; tables, tray "
    "and boxes have sizes of their own, which the paper does not tell.",
    "The two bounds of the NLP are our own: compiled stage kernels for the coarse bound, and "
    "inverse kinematics, sampling, optimisation and time parameterisation for the path bound. "
    "Every keyframe and every path that counts as feasible was checked in PyBullet.",
    "The state s_k is taken after the acting arm has retreated.",
    "Problems that are satisfied at the start are counted apart; the paper does not say whether "
    "they are in its averages.",
    "Tree size counts every node generated, the root included, over all attempts.",
    "Each problem of Table III is solved in several initial configurations; the paper uses one.",
    "The paper's times were measured on its own machine, so only their growth compares.",
)
"""Where this work departs from the paper, or had to choose."""


_MARKERS = (
    "Means over all problems of the same K, slightly shifted sideways to keep planners apart. "
    "Dashed: greedy. Open markers: the paper's means. White dots: not all problems are solved, and "
    "the mean is over those that are."
)
"""How to read the curves of planners."""


def compose(
    inputs: Inputs,
    params: Params,
    novelty: Mapping[str, str],
    tables: Mapping[str, Table],
    rest: Mapping[str, str],
    replays: Sequence[tuple[str, str]],
) -> Document:
    """Arrange the report.

    Args:
        inputs: for the sentences and the pictures of the setups.
        params: for the seeds.
        novelty: of every objective.
        tables: by name.
        rest: by figure, what its caption says of that which is not drawn.
        replays: (address, text) of every replay.
    """
    generalization: list[Block] = [
        tables["table_1"],
        findings.unseen(novelty, _symmetric(params)),
        tables["unseen"],
        Picture(
            "success.svg",
            "Outcomes by type of objective",
            "Test configurations; n: problems not satisfied at the start, per planner. "
            f"{rest['success']}",
        ),
    ]
    if "draws" in tables:
        more = "The studies: this spread, ablations, data efficiency, feasibility classifier"
        generalization[1:1] = [tables["draws"], Links([("../docs/studies.md", more)])]
    scalability: list[Block] = [
        Picture(
            "solved.svg",
            "Problems solved",
            "Over all problems of the same K, each in several configurations.",
        ),
        tables["winners"],
        Picture(
            "tree_size.svg",
            "Tree size against the number of actions",
            f"{_MARKERS} Crosses: stopped at the limit of the tree size, which is dotted.",
        ),
        tables["table_3_tree_size"],
        Picture(
            "time.svg",
            "Time to a plan with its motion against the number of actions",
            f"{_MARKERS} The paper's times are those of its own machine.",
        ),
        tables["table_3_time"],
        Folded(tables["table_3_details"]),
    ]
    policy: list[Block] = [
        tables["training"],
        "Losses by epoch: “dvc plots show”, or MLflow.",
        Picture(
            "confusion.svg",
            "Where sub-policies err",
            "Validation samples in %, rows normalised. Where several actions are right, an entry "
            f"off the diagonal need not be a mistake. {rest['confusion']}",
        ),
    ]
    geometry: list[Block] = [
        Gallery([Picture(f"setup_{s}.png", f"Setup {s}") for s in inputs.setups]),
        tables["enumeration"],
        Picture(
            "feasible_share.svg",
            "Feasible share by arm and table",
            "Share of sequences that stay feasible with one more action, by the arm of that "
            "action and where it takes the box from or puts it. Training and test configurations. "
            f"{rest['feasible_share']}",
        ),
        Picture(
            "failures.svg",
            "Where plans fail and why",
            "Sequences infeasible for the coarse bound by the constraint that stays violated and "
            "the action at which it does. Training and test configurations.",
        ),
    ]
    if "geometry" in tables:
        geometry.append(tables["geometry"])
    answers = findings.answers(inputs.generalization, inputs.scalability, inputs.timing)
    if rows := (inputs.cases_compared or {}).get("rows"):
        answers["Where geometry decides"] = f"In crowded rows {cases.headline(rows)}"
    sections = [
        Section("Question and answer", [findings.QUESTION, Answers(answers)]),
        Section("Generalization", generalization),
        Section("Scalability", scalability),
        Section("Policy", policy),
        Section("Geometry", geometry),
        Section("Differences from the paper", [Bullets(DIFFERENCES)]),
        Section("Reproduction", [*_reproduction(params)]),
    ]
    if inputs.cases and inputs.cases_compared:
        sections.insert(1, Section("Where geometry decides", [*_cases(inputs, tables)]))
    if replays:
        text = "Plans as 3D replays in the browser, one self-contained page each."
        sections.insert(5, Section("Replays", [text, Links(replays)]))
    return Document(
        "Guided sequential manipulation planning: results",
        "Tables I and III of “Guided Sequential Manipulation Planning Using a Hierarchical "
        "Policy”, computed anew and set beside the paper's figures; planners the paper does not "
        "have; and the training and geometry behind them.",
        sections,
    )


def _cases(inputs: Inputs, tables: Mapping[str, Table]) -> Iterator[Block]:
    """The headline: what learning is worth where symbols alone mislead."""
    assert inputs.cases is not None
    assert inputs.cases_compared is not None
    yield cases.QUESTION
    yield Answers(cases.answers(inputs.cases_compared))
    yield tables["cases_compared"]
    yield Picture(
        "cases.svg",
        "Calls of the coarse bound against the number of boxes",
        "Means over scenes and trainings; a search without a plan within 100 calls counts as 100. "
        "Dashed: greedy.",
    )
    for name in inputs.cases:
        yield tables[f"case_{name}"]
        yield Links([(f"{name}/replay.html", "One plan as a 3D replay in the browser")])


def _symmetric(params: Params) -> list[str]:
    """The policies to which all boxes are alike."""
    return [policy.label for policy in TRAINED_POLICIES.values() if policy.symmetric(params)]


def _reproduction(params: Params) -> Sequence[Block]:
    scenes, limits = params.generate_scenes, params.compare_scalability
    return (
        f"All figures come from one run of “{COMMAND}” with the parameters of params.yaml. The "
        "same seeds give the same figures on the same machine, times aside.",
        Bullets(
            (
                f"Seeds: training scenes {scenes.seed_training}, test scenes {scenes.seed_test}, "
                f"scalability scenes {scenes.seed_scalability}, draw of the training objectives "
                f"{params.build_dataset.seed}, training {params.train_policy.seed}.",
                f"Configurations: {scenes.training_configurations} for training, "
                f"{scenes.test_configurations} for test, {scenes.scalability_configurations} of "
                "each setup for scalability.",
                f"Training objectives: {params.build_dataset.training_objectives} of the 72 with "
                "two goals.",
                f"Limits: depth {params.evaluate_generalization.max_depth} in the test of "
                f"generalization and {limits.max_depth} in that of scalability, "
                f"{limits.reattempts} reattempts, {limits.max_tree_size:,} nodes.",
            )
        ),
    )
