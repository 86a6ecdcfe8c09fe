"""A task as a Gymnasium environment: symbolic actions, geometric verdicts."""

from itertools import product
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from guided_lgp.bounds.results import Keyframe
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import (
    Action,
    Goal,
    Objective,
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    parse_objective,
    satisfied,
    successor,
    validate_objective,
)
from guided_lgp.params import PlanningParams, load_planning
from guided_lgp.scene import Scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import World
from guided_lgp.search.observation import observe, start

_REACH = 100.0
"""m. Bound of every coordinate in the observation space."""

Observation = dict[str, Any]


class TaskEnv(gymnasium.Env[Observation, np.int64]):
    """One scene and its goals; an episode is a skeleton that grows by an action a step.

    An action is a number into ``actions``, all that can be named. One that is not applicable, or
    that the coarse bound finds infeasible after those before, changes nothing. The episode ends
    when all goals hold and the path bound has a motion for the skeleton.

    Observations: ``positions`` (symbols, 3) in m, ``parents`` (movables,) the number among the
    symbols of what each stands on or is held by, ``goals`` whether each holds. Rewards: 1 at the
    end, -0.1 for an action that changes nothing, else 0. ``info``: ``action``, ``verdict``
    (``feasible``, ``infeasible`` or ``not applicable``), ``reason`` and ``action_mask``.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 1}  # noqa: RUF012

    def __init__(
        self,
        scene: Scene,
        objective: list[str],
        params: PlanningParams | None = None,
        max_steps: int = 50,
        render_mode: str | None = None,
    ) -> None:
        """Check the task and make the spaces.

        Args:
            scene: where every episode starts.
            objective: goals, as text.
            params: limits of the bounds; the shipped ones by default.
            max_steps: after so many steps an episode is truncated.
            render_mode: ``rgb_array`` or none.

        Raises:
            InputError: a fault in the scene or in the goals.
        """
        validate_scene(scene)
        self.objective: Objective = parse_objective(objective)
        validate_objective(self.objective, scene.symbols, scene.state)
        self.actions: tuple[Action, ...] = tuple(_nameable(scene.symbols))
        self.render_mode = render_mode
        self._scene, self._symbols = scene, scene.symbols
        self._numbers = {action: number for number, action in enumerate(self.actions)}
        self._bounds = SceneBounds(scene, (params or load_planning()).bounds)
        self._max_steps = max_steps
        count = len(self._symbols.names)
        movable = len(self._symbols.movable)
        self.action_space = spaces.Discrete(len(self.actions))
        self.observation_space = spaces.Dict(
            {
                "positions": spaces.Box(-_REACH, _REACH, (count, 3), np.float64),
                "parents": spaces.MultiDiscrete(np.full(movable, count)),
                "goals": spaces.MultiBinary(len(self.objective)),
            }
        )
        self._begin()

    def _begin(self) -> None:
        self._skeleton: Skeleton = ()
        self._state: State = self._scene.state
        self._keyframe: Keyframe = start(self._scene)
        self._steps = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Go back to the scene's start."""
        super().reset(seed=seed)
        self._begin()
        return self._observation(), {"action_mask": self.action_mask()}

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Try an action; see the class."""
        chosen = self.actions[int(action)]
        self._steps += 1
        verdict, reason = self._try(chosen)
        reward = 0.0 if verdict == "feasible" else -0.1
        done = False
        if verdict == "feasible" and satisfied(self._state, self.objective):
            path = self._bounds.path(self._skeleton)
            done, reward = path.feasible, float(path.feasible)
            reason = str(path.failure or "")
        info = {
            "action": str(chosen),
            "verdict": verdict,
            "reason": reason,
            "action_mask": self.action_mask(),
        }
        return self._observation(), reward, done, self._steps >= self._max_steps, info

    def _try(self, action: Action) -> tuple[str, str]:
        """Take the action if it is possible: the verdict, and why not."""
        if action not in applicable_actions(self._state, self._symbols):
            return "not applicable", ""
        result = self._bounds.coarse((*self._skeleton, action))
        if not result.feasible:
            return "infeasible", str(result.failure)
        self._skeleton = result.skeleton
        self._state = successor(self._state, action)
        self._keyframe = result.after_action[-1]
        return "feasible", ""

    def action_mask(self) -> NDArray[np.int8]:
        """(actions,) 1 for those that are applicable, whatever geometry says."""
        mask = np.zeros(len(self.actions), np.int8)
        mask[[self._numbers[a] for a in applicable_actions(self._state, self._symbols)]] = 1
        return mask

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (height, width, 3) of the current configuration, in mode ``rgb_array``."""
        if self.render_mode is None:
            return None
        with World(self._scene) as world:
            world.set(self._keyframe.q, self._keyframe.boxes)
            return world.render()

    def _observation(self) -> Observation:
        names = self._symbols.names
        positions = observe(self._scene, self._keyframe)
        parents = [names.index(self._state.parent_of(body)) for body in self._symbols.movable]
        holds = [self._holds(goal) for goal in self.objective]
        return {
            "positions": np.array([positions[name] for name in names]),
            "parents": np.array(parents),
            "goals": np.array(holds, np.int8),
        }

    def _holds(self, goal: Goal) -> bool:
        return self._state.satisfies(goal)


def _nameable(symbols: Symbols) -> list[Action]:
    """Every action that the symbols' types allow, in the order of the declarations."""
    return [
        Action(instruction.name, chosen)
        for instruction in symbols.domain.instructions
        for chosen in product(*(symbols.of(v.type.name) for v in instruction.parameters))
        if len(set(chosen)) == len(chosen)
    ]
