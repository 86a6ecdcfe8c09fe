"""What the report says in words about its figures."""

from collections import Counter
from collections.abc import Mapping, Sequence

from guided_lgp.report.analysis import NEW, RENAMED, SEEN
from guided_lgp.report.cells import percent


def unseen(kinds: Mapping[str, str], symmetric: Sequence[str]) -> str:
    """What "unseen" means for a policy to which all boxes are alike.

    Args:
        kinds: of every objective; see :func:`guided_lgp.report.analysis.novelty`.
        symmetric: names of the policies to which they are.
    """
    counts = Counter(kinds.values())
    total = counts[RENAMED] + counts[NEW]
    return (
        f"Of the {total} unseen objectives, {counts[RENAMED]} "
        f"({percent(counts[RENAMED] / max(total, 1))}) are one of the {counts[SEEN]} training "
        "objectives with its boxes renamed. The paper's networks have an input for every box and "
        "must generalize to these objectives. All boxes are alike to "
        f"{_join([f'the {name.lower()}' for name in symmetric])}, so that to a policy of this kind "
        f"they are not new. The other {counts[NEW]} are new under any names: objectives of one "
        "goal, which no training objective has, and pairs of goals of a kind that was not drawn."
    )


def _join(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
