"""The coarse bound P_coarse of a skeleton (paper, eq. 3): starts, solver, verification."""

import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import accumulate, chain, islice

import numpy as np

from guided_lgp.bounds.checks import top_of
from guided_lgp.bounds.coarse.decoding import Decoder
from guided_lgp.bounds.coarse.facts import Facts
from guided_lgp.bounds.coarse.formulation import Formulation
from guided_lgp.bounds.coarse.programs import Formulators, Programs
from guided_lgp.bounds.coarse.solver import Settings, Solution, Solver, default_solver
from guided_lgp.bounds.coarse.starts import Starts
from guided_lgp.bounds.coarse.variants import Variant
from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.bounds.goals import NO_TERMS, GoalTerms
from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.results import Array, CoarseResult, Failure, Keyframe
from guided_lgp.bounds.terms import balanced
from guided_lgp.bounds.terms.term import UngraspableError
from guided_lgp.bounds.verify import verify_keyframes
from guided_lgp.logic import Skeleton, format_skeleton, successor
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World, world_of


@dataclass(frozen=True)
class CoarseSolution(CoarseResult):
    """A coarse result that remembers where its solver stopped, to start longer skeletons."""

    values: Array | None = field(default=None, compare=False, repr=False)
    variant: Variant = field(default=Variant(), compare=False, repr=False)


class CoarseBound:
    """P_coarse for the skeletons of one scene; every feasible verdict has been verified.

    A verdict depends only on the scene, the skeleton and ``restarts``: it is defined by recursion
    over the prefixes, whose constraints are a subset. A skeleton with an infeasible prefix is
    infeasible; otherwise the first start continues the solution of the prefix.
    """

    def __init__(
        self,
        scene: Scene,
        restarts: int,
        solver: Solver | None = None,
        deadline: Deadline = NEVER,
        facts: Facts | None = None,
        world: World | None = None,
        goals: GoalTerms = NO_TERMS,
        firm: bool = False,
    ) -> None:
        """Prepare a scene.

        Args:
            scene: the scene.
            restarts: the number of starts before giving up.
            solver: if not the default one.
            deadline: when to give up in any case.
            facts: of this scene or one with more boxes, if there are some already.
            world: of this scene, if there is one already.
            goals: terms of which those of every moment always hold, and those of the end in
                ``finish`` and ``solutions``.
            firm: whether hands then hold their load steadily, and what they put down stands
                without what it carries, where there is room.
        """
        self.scene = scene
        self._restarts = restarts
        self._deadline = deadline
        self._goals, self._early = goals, replace(goals, final=())
        self._solver = solver or default_solver(scene.robot.description)
        self._geometry = SceneGeometry(scene)
        self.facts = facts or Facts(self._geometry)
        self._formulators = Formulators(self._geometry, goals)
        wishes = goals.firmer(scene.robot.description.grippers) if firm else ()
        self._wished = tuple(Formulators(self._geometry, wish) for wish in wishes)
        self._starts = Starts(self._geometry, self._solver)
        self._decoder = Decoder(self._geometry)
        self._settings = Settings()
        self._world = world or world_of(scene)

    @property
    def overhung(self) -> frozenset[str]:
        """What may be stood on and is, in part, below something else."""
        return self._geometry.overhung

    def solve(self, skeleton: Skeleton, prefix: CoarseResult | None = None) -> CoarseResult:
        """The verdict on a skeleton.

        Args:
            skeleton: at least one action; each applicable after those before it.
            prefix: the result of this bound for ``skeleton[:-1]``; solved first if not given.

        Raises:
            ValueError: the prefix is the result for another skeleton.
            OutOfTimeError: the deadline has passed.
        """
        started = time.perf_counter()
        if prefix is not None and prefix.skeleton != skeleton[:-1]:
            raise ValueError("the prefix belongs to another skeleton")
        if len(skeleton) > 1 and (
            prefix is None or (prefix.feasible and not isinstance(prefix, CoarseSolution))
        ):
            prefix = self.solve(skeleton[:-1])
        if prefix is not None and not prefix.feasible:
            return CoarseResult(skeleton, feasible=False, failure=prefix.failure, restarts=0)
        result = self._search(skeleton, prefix if isinstance(prefix, CoarseSolution) else None)
        elapsed = time.perf_counter() - started
        return CoarseSolution(**(vars(result) | {"time_s": elapsed}))

    def finish(self, result: CoarseResult) -> CoarseResult:
        """The verdict on a skeleton at whose end the terms of the goals hold, from one without."""
        started = time.perf_counter()
        if result.feasible and self._goals.final:
            programs = self._programs(result.skeleton)
            found = self._first_feasible(programs, None, programs.variants.starts(self._restarts))
            result = replace(found, time_s=time.perf_counter() - started)
        return result

    def near(self, found: CoarseResult) -> Iterator[CoarseResult]:
        """A solution; of firm bounds also a firmer one near it, and it again, for other grips.

        Where something stands only by what it carries, one in which nothing does comes first.
        """
        wished = self._wished_programs(found.skeleton)
        if self.leans(found):
            unaided = wished[-1]
            yield from islice(chain(self._beside(found, unaided), self._from_starts(unaided, 1)), 1)
        yield found
        firmer = chain.from_iterable(self._beside(found, wish) for wish in wished)
        yield from islice((other for other in firmer if not self.leans(other)), 1)
        if wished:
            yield found

    def leans(self, found: CoarseResult) -> bool:
        """Whether firm bounds see something put down that stands there only by what it carries."""
        if not self._wished_programs(found.skeleton):
            return False
        states = accumulate(found.skeleton, successor, initial=self.scene.state)
        masses = {name: body.mass for name, body in self._geometry.bodies.items()}
        for action, after, keyframe in zip(
            found.skeleton, islice(states, 1, None), found.after_action, strict=True
        ):
            body = self._geometry.domain.bind(action).body
            support = after.support_of(body)
            if support is not None and after.standing_on(body):
                boxes = {name: pose.tolist() for name, pose in keyframe.boxes.items()}
                if balanced.leans(body, boxes, masses, top_of(self.scene, boxes, support)):
                    return True
        return False

    def solutions(self, skeleton: Skeleton, count: int) -> Iterator[CoarseResult]:
        """Up to ``count`` further verified solutions, with the goals, from independent starts.

        Of firm bounds first as many of the firmer ones; those in which something stands only by
        what it carries, come after them.
        """
        leaning = []
        for wish in self._wished_programs(skeleton):
            for found in self._from_starts(wish, count):
                if self.leans(found):
                    leaning.append(found)
                else:
                    yield found
        yield from leaning
        yield from self._from_starts(self._programs(skeleton), count)

    def _wished_programs(self, skeleton: Skeleton) -> list[Programs]:
        """Of firm bounds those with more than the goals, where hands hold boxes that carry others:
        the last with all that is wished.
        """
        states = accumulate(skeleton, successor, initial=self.scene.state)
        if not any(state.standing_on(box) for state in states for box, _ in state.held):
            return []
        return [Programs(wish, self._geometry, skeleton, wish.goals) for wish in self._wished]

    def _beside(self, found: CoarseResult, wish: Programs) -> Iterator[CoarseResult]:
        """The solution nearest to another one that has what is wished, if it is good."""
        if not isinstance(found, CoarseSolution):
            return
        formulation = wish.built(0, found.variant)
        random = _Random(found.skeleton, 0)
        start = self._starts.draw(formulation, random, noise=0.0, warm_start=found.values)
        solution = self._solver.solve(formulation.program, start, self._settings)
        firmer = self._check(
            wish, formulation, found.variant, solution, restarts=found.restarts, prefix=None
        )
        if firmer.feasible:
            yield firmer

    def _from_starts(self, programs: Programs, count: int) -> Iterator[CoarseResult]:
        found = 0
        for number in range(self._restarts, self._restarts + 3 * count):
            try:
                result = self._restart(programs, number, None)
            except UngraspableError:
                return
            if result.feasible:
                found += 1
                yield result
            if found == count:
                return

    def _programs(self, skeleton: Skeleton) -> Programs:
        """With all goals."""
        return Programs(self._formulators, self._geometry, skeleton, self._goals)

    def _search(self, skeleton: Skeleton, prefix: CoarseSolution | None) -> CoarseSolution:
        """The verdict on a skeleton, whose prefix is feasible, without the goals' places."""
        programs = Programs(self._formulators, self._geometry, skeleton, self._early)
        return self._first_feasible(programs, prefix, self._restarts)

    def _first_feasible(
        self, programs: Programs, prefix: CoarseSolution | None, starts: int
    ) -> CoarseSolution:
        """Start after start until one leads to a verified solution, unless a fact forbids it.

        A fact that has to be proved first is worth its time when the first start has failed.
        """
        skeleton, failures = programs.skeleton, list[Failure]()
        fact = self.facts.known(skeleton)
        for number in range(starts):
            if number == 1:
                fact = self.facts.impossible(skeleton)
            if fact:
                failure = Failure(len(skeleton) - 1, str(fact), np.nan, _PROVED)
                return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=0)
            try:
                result = self._restart(programs, number, prefix)
            except UngraspableError as error:
                failure = Failure(error.action, f"width of {error.box}", error.excess, "both sides")
                return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=0)
            if result.feasible:
                return result
            assert result.failure is not None
            failures.append(result.failure)
        # the prefix is feasible: what fails late in the skeleton tells more
        failure = min(failures, key=lambda failure: (-failure.action, failure.violation))
        failure = replace(failure, tried=f"{starts} starts of the coarse bound")
        return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=starts)

    def _restart(
        self, programs: Programs, number: int, prefix: CoarseSolution | None
    ) -> CoarseSolution:
        """One start: the first and every other one keep the solution of the prefix.

        The first one leaves the prefix where it is, if it can: then it need not be verified again.
        """
        self._deadline.check()
        kept = prefix if number == 0 or number % 2 else None
        random = _Random(programs.skeleton, number)
        variant = Variant() if kept is None else kept.variant
        variant = programs.variants.tried(number, random, variant)
        formulation = programs.built(number, variant)
        start = self._starts.draw(
            formulation,
            random,
            noise=0.0 if number == 0 else _NOISE,
            warm_start=None if kept is None else kept.values,
        )
        check = partial(self._check, programs, formulation, variant, restarts=number + 1)
        if kept is not None and kept.values is not None and number == 0:
            solution = self._solver.solve(formulation.program, start, _BRIEF, len(kept.values))
            if solution.converged(_BRIEF):
                result = check(solution, prefix=kept)
                if result.feasible:
                    return result
        solution = self._solver.solve(formulation.program, start, self._settings)
        if kept is not None and not _begins_with(solution.values, kept.values):
            kept = None
        return check(solution, prefix=kept)

    def _check(
        self,
        programs: Programs,
        formulation: Formulation,
        variant: Variant,
        solution: Solution,
        *,
        restarts: int,
        prefix: CoarseSolution | None,
    ) -> CoarseSolution:
        """Decode a solution and verify it; a prefix has been, where it is the same."""
        skeleton = programs.skeleton
        if not solution.converged(self._settings):
            failure = self._decoder.failure(formulation, solution, self._settings.slack)
            return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=restarts)
        at_switch, after_action = self._keyframes(formulation, solution, prefix)
        verified = 0 if prefix is None else len(prefix.skeleton)
        found = verify_keyframes(self._world, skeleton, at_switch, after_action, verified)
        if found is None:
            missed = programs.goals.faults(self.scene, after_action[-1].boxes)
            found = replace(missed[0], action=len(skeleton) - 1) if missed else None
        if found is not None:
            failure = Failure(found.action, found.constraint, found.amount, "verification")
            return CoarseSolution(skeleton, feasible=False, failure=failure, restarts=restarts)
        return CoarseSolution(
            skeleton,
            feasible=True,
            at_switch=at_switch,
            after_action=after_action,
            restarts=restarts,
            values=solution.values[: formulation.program.variables],
            variant=variant,
        )

    def _keyframes(
        self, formulation: Formulation, solution: Solution, prefix: CoarseSolution | None
    ) -> tuple[tuple[Keyframe, ...], tuple[Keyframe, ...]]:
        """At each switch and after each action; those of the prefix are there already."""
        at_switch, after = formulation.at_switch, formulation.after_action
        decode = partial(self._decoder.keyframes, formulation, values=solution.values)
        if prefix is None:
            return decode(at_switch), decode(after)
        last = prefix.after_action[-1].boxes
        known = {id(where): last[name] for name, where in after[-2].boxes.items()}
        switch, end = decode((at_switch[-1], after[-1]), known=known)
        return (*prefix.at_switch, switch), (*prefix.after_action, end)


_PROVED = "proved for the arm alone, collisions left out"
"""What was tried where a fact says no."""

_BRIEF = Settings(steps=50, patience=15)
"""While the prefix stays where it is, there is little to do."""

_NOISE = 0.3
"""Spread of the choices in all starts but the first."""


def _begins_with(values: Array, prefix: Array | None) -> bool:
    return prefix is not None and np.array_equal(values[: len(prefix)], prefix)


class _Random:
    """Random numbers of one start: of the skeleton and the number of the start only.

    Many starts need none, so that the generator is made when it is asked for.
    """

    def __init__(self, skeleton: Skeleton, number: int) -> None:
        self._skeleton, self._number = skeleton, number
        self._generator: np.random.Generator | None = None

    def __call__(self) -> np.random.Generator:
        if self._generator is None:
            seed = zlib.crc32(format_skeleton(self._skeleton).encode())
            self._generator = np.random.default_rng([seed, self._number])
        return self._generator
