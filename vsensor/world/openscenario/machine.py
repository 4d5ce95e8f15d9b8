"""The storyboard as a value machine: `advance(state)` goes one step of 10 ms, always to the same bits.

    entities to t --> ends of actions --> triggers (until nothing changes) --> who follows whom --> state
                      `- elements.play -------------------------------------------------------´

A trigger looks at the entities at the step's own time; what it starts begins there. Elements that end and
begin at one step see each other: an event may start on the start of its act.
"""

from dataclasses import replace
from math import isfinite

from msgspec import structs

from vsensor.errors import StoryError
from vsensor.world.openscenario.acting import begin
from vsensor.world.openscenario.action_data import Teleport
from vsensor.world.openscenario.bodies import Body, moved
from vsensor.world.openscenario.elements import play, start
from vsensor.world.openscenario.model import Level, Story
from vsensor.world.openscenario.spots import Track
from vsensor.world.openscenario.state import STEP_NS, Memory, Phase, StoryState
from vsensor.world.openscenario.tracks import Tracks
from vsensor.world.openscenario.trajectories import finish_paths
from vsensor.world.openscenario.triggers import trigger_value
from vsensor.world.openscenario.work import Work

CALM_M = 200.0
"""Whoever has so much road ahead is not looked at before it can have driven it."""


class Machine:
    """A story and the roads that it is played on; holds nothing that a run changes but caches."""

    def __init__(self, story: Story, tracks: Tracks, ego: str) -> None:
        self.story = story
        self.tracks = tracks
        self._calm: dict[int, tuple[Body, int]] = {}
        self._reached: dict[int, tuple[Track, float]] = {}
        self.ego = next(k for k, entity in enumerate(story.entities) if entity.name == ego)

    def initial_state(self) -> StoryState:
        """Return the state at 0: everybody placed, the first triggers looked at. Raises StoryError."""
        nodes, conditions = len(self.story.nodes), len(self.story.conditions)
        blank = StoryState(
            t_ns=0,
            bodies=(None,) * len(self.story.entities),
            phases=(Phase.IDLE,) * nodes,
            runs=(0,) * nodes,
            memories=(Memory(),) * conditions,
            parameters=self.story.parameters,
        )
        work = self.work(blank, 0)
        self._init(work)
        for place, node in enumerate(self.story.nodes):
            if node.level is Level.STORY:
                start(work, place)
        play(work)
        return self._state(work, blank)

    def advance(self, state: StoryState) -> StoryState:
        """Return the state one step later; raises StoryError for what cannot be done to the ego."""
        if state.ended_ns is not None:
            return replace(state, t_ns=state.t_ns + STEP_NS, marks=frozenset(), happened=())
        work = self.work(state, state.t_ns + STEP_NS)
        busy = [
            entity for entity, body in enumerate(state.bodies) if not self._is_calm(entity, body, work.t_ns)
        ]
        for entity in busy:
            body = state.bodies[entity]
            if body is not None:
                after, motion = moved(self.tracks, body, work.t_ns)
                if after is not body:
                    work.put(entity, after, motion)
        finish_paths(work)
        self._end_of_road(work, busy)
        play(work)
        return self._state(work, state)

    def work(self, state: StoryState, t_ns: int) -> Work:
        """Return a state to be looked at, at a time up to one step after it."""
        return Work(
            story=self.story,
            tracks=self.tracks,
            ego=self.ego,
            t_ns=t_ns,
            bodies=list(state.bodies),
            phases=list(state.phases),
            runs=list(state.runs),
            memories=list(state.memories),
            parameters=dict(state.parameters),
            running=list(state.running),
            next_number=state.next_number,
            before=state,
        )

    def _state(self, work: Work, before: StoryState) -> StoryState:
        fired, _ = trigger_value(work, self.story.stop)
        ended = before.ended_ns
        if fired and ended is None:
            ended = work.t_ns
            work.say("the storyboard stops")
        return StoryState(
            t_ns=work.t_ns,
            bodies=tuple(work.bodies),
            phases=tuple(work.phases),
            runs=tuple(work.runs),
            marks=frozenset(work.marks),
            running=tuple(work.running),
            memories=tuple(work.memories),
            parameters=work.parameters,
            next_number=work.next_number,
            ended_ns=ended,
            ended_by="its stop trigger" if fired else before.ended_by,
            happened=tuple(work.happened),
        )

    def _init(self, work: Work) -> None:
        """Place everybody, those that stand beside others after them, then begin the other actions."""
        waiting = [(who, action) for who, action in self.story.init if isinstance(action, Teleport)]
        for _ in range(len(waiting) + 1):
            later = []
            for actor, action in waiting:
                ref = action.position.ref
                if ref >= 0 and work.body(work.leader(ref)) is None:
                    later.append((actor, action))
                else:
                    begin(work, -1, action, actor)
            if len(later) == len(waiting):
                break
            waiting = later
        for actor, action in waiting:
            begin(work, -1, action, actor)  # says what is missing
        if work.body(work.ego) is None:
            name = self.story.entities[work.ego].name
            raise StoryError(f"{self.story.path}: {name} is placed nowhere: a <TeleportAction> was expected")
        for place, (actor, other) in enumerate(self.story.init):
            if not isinstance(other, Teleport):
                begin(work, -2 - place, other, actor)

    def _is_calm(self, entity: int, body: Body | None, t_ns: int) -> bool:
        """Return whether a body moves by its own closed form, and its road does not end yet."""
        if body is None or body.rod is not None:
            return True
        known = self._calm.get(entity)
        return known is not None and known[0] is body and t_ns < known[1]

    def _end_of_road(self, work: Work, busy: list[int]) -> None:
        """Let those stand who have come to the end of their road."""
        for entity in busy:
            body, motion = work.bodies[entity], work.motion(entity)
            if body is None or motion is None or body.is_ended or body.path is not None:
                continue
            if _moves_in_steps(body) and self._is_known(entity, body.track, motion.s_m):
                continue
            if not isfinite(motion.s_m):
                raise StoryError(f"{self.story.path}: {self.story.entities[entity].name} drives to no number")
            corridor = self.tracks.corridor(body.track)
            if corridor.reaches(max(motion.s_m, 0.0) + CALM_M):
                self._reached[entity] = body.track, motion.s_m + CALM_M
                if not _moves_in_steps(body):
                    fastest = _fastest_mps(body)
                    self._calm[entity] = body, work.t_ns + int(CALM_M / max(fastest, 1.0) * 1e9)
            elif not corridor.reaches(max(motion.s_m, 0.0)):
                at_end = structs.replace(body, t_ns=work.t_ns, s_m=corridor.length_m, is_ended=True)
                work.put(entity, structs.replace(at_end, driven_m=motion.driven_m, follow=None))
                work.say(f"{self.story.entities[entity].name} comes to the end of its road")

    def _is_known(self, entity: int, track: Track, s_m: float) -> bool:
        """Return whether the road is known to go on to a place."""
        reached = self._reached.get(entity)
        return reached is not None and reached[0] is track and s_m <= reached[1]


def _fastest_mps(body: Body) -> float:
    return max(body.speed.start_mps, body.speed.end_mps)


def _moves_in_steps(body: Body) -> bool:
    """Return whether a body drives beside its lane's middle, or is about to leave it."""
    return body.lateral.length != 0.0 or (body.lateral.end_m != 0.0 and _fastest_mps(body) != 0.0)
