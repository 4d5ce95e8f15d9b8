"""The storyboard as a value machine: `advance(state)` goes one step of 10 ms, always to the same bits.

    entities to t --> ends of actions --> triggers (until nothing changes) --> who follows whom --> state

A trigger looks at the entities at the step's own time; what it starts begins there. Elements that end and
begin at one step see each other: an event may start on the start of its act.
"""

from dataclasses import replace
from math import isfinite

from vsensor.errors import StoryError
from vsensor.world.openscenario.acting import begin, is_done, stop
from vsensor.world.openscenario.bodies import Body, moved
from vsensor.world.openscenario.following import keep_in_step
from vsensor.world.openscenario.model import Action, Level, NoAction, Node, ParameterAction, Story, Teleport
from vsensor.world.openscenario.state import STEP_NS, Memory, Phase, Running, StoryState
from vsensor.world.openscenario.towing import tow
from vsensor.world.openscenario.tracks import Tracks
from vsensor.world.openscenario.trajectories import finish_paths
from vsensor.world.openscenario.triggers import trigger_value
from vsensor.world.openscenario.work import Work

MOST_PASSES = 64
"""Elements that start each other within one step, at most so many times around."""

CALM_M = 200.0
"""Whoever has so much road ahead is not looked at before it can have driven it."""


class Machine:
    """A story and the roads that it is played on; holds nothing that a run changes but caches."""

    def __init__(self, story: Story, tracks: Tracks, ego: str) -> None:
        self.story = story
        self.tracks = tracks
        self._calm: dict[int, tuple[Body, int]] = {}
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
                self._start(work, place, ())
        self._play(work)
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
                after = moved(self.tracks, body, work.t_ns)
                if after is not body:
                    work.put(entity, after)
        finish_paths(work)
        self._end_of_road(work, busy)
        self._play(work)
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

    def _action(self, one: Running) -> Action:
        if one.node < 0:
            return self.story.init[-2 - one.node][1]
        action = self.story.nodes[one.node].action
        assert action is not None
        return action

    def _play(self, work: Work) -> None:
        """End what is done, start what is triggered, until nothing changes any more."""
        for _ in range(MOST_PASSES):
            before = len(work.marks), len(work.running)
            self._end_actions(work)
            self._end_elements(work)
            self._triggers(work)
            if before == (len(work.marks), len(work.running)):
                break
        keep_in_step(work)
        tow(work)

    def _end_actions(self, work: Work) -> None:
        for one in list(work.running):
            if is_done(work, one, self._action(one)):
                work.running.remove(one)

    def _end_elements(self, work: Work) -> None:
        """Complete, from actions up to stories, what has nothing left to do."""
        going = {one.node for one in work.running}
        nodes = self.story.nodes
        for place in range(len(nodes) - 1, -1, -1):
            if work.phases[place] is not Phase.RUNNING:
                continue
            node = nodes[place]
            if node.level is Level.ACTION:
                if place not in going:
                    self._complete(work, place, "endTransition")
            elif all(work.phases[child] is Phase.COMPLETE for child in node.children):
                self._run_over(work, place, node)

    def _run_over(self, work: Work, place: int, node: Node) -> None:
        """End one execution; an event or group that may run again goes back to where it waits."""
        if node.level in (Level.EVENT, Level.GROUP) and work.runs[place] < node.most_runs:
            work.marks.add((place, "endTransition"))
            if node.level is Level.GROUP and node.children:
                self._start(work, place, ())
            elif node.level is Level.EVENT:
                self._standby(work, place)
            else:
                self._complete(work, place, "endTransition")
        else:
            self._complete(work, place, "endTransition")

    def _complete(self, work: Work, place: int, mark: str) -> None:
        work.phases[place] = Phase.COMPLETE
        work.marks.add((place, mark))
        node = self.story.nodes[place]
        if node.level is Level.EVENT:
            work.say(f"event {node.name} ends")

    def _standby(self, work: Work, place: int) -> None:
        work.phases[place] = Phase.STANDBY
        node = self.story.nodes[place]
        for trigger in (node.start, node.stop):
            for group in trigger.groups if trigger else ():
                work.fresh.update(group)
                for condition in group:
                    work.memories[condition] = Memory()

    def _triggers(self, work: Work) -> None:
        """Look at the triggers of everything that waits or may be stopped."""
        for place, node in enumerate(self.story.nodes):
            if node.level is Level.ACT and work.phases[place] is Phase.RUNNING and node.stop is not None:
                if trigger_value(work, node.stop)[0]:
                    self._stop(work, place)
            elif work.phases[place] is Phase.STANDBY:
                fired, who = trigger_value(work, node.start)
                if (fired or node.start is None) and self._parent_runs(work, node):
                    self._fire(work, place, who)

    def _parent_runs(self, work: Work, node: Node) -> bool:
        return node.parent < 0 or work.phases[node.parent] is Phase.RUNNING

    def _fire(self, work: Work, place: int, who: tuple[int, ...]) -> None:
        """Start an act or an event that was triggered, as its priority has it."""
        node = self.story.nodes[place]
        if node.level is Level.EVENT:
            others = [
                other
                for other in self.story.nodes[node.parent].children
                if other != place and work.phases[other] is Phase.RUNNING
            ]
            if node.priority == "skip" and others:
                work.runs[place] += 1
                work.marks.add((place, "skipTransition"))
                if work.runs[place] >= node.most_runs:
                    work.phases[place] = Phase.COMPLETE
                return
            if node.priority == "overwrite":
                for other in others:
                    self._stop(work, other)
        self._start(work, place, who)

    def _start(self, work: Work, place: int, who: tuple[int, ...]) -> None:
        """Begin one execution of an element; acts and events within wait for their triggers."""
        node = self.story.nodes[place]
        if node.level in (Level.EVENT, Level.GROUP) and node.most_runs == 0:
            work.phases[place] = Phase.COMPLETE
            return
        work.phases[place] = Phase.RUNNING
        work.runs[place] += 1
        work.marks.add((place, "startTransition"))
        if node.level is Level.EVENT:
            work.say(f"event {node.name} starts")
            self._act(work, node, who)
            return
        for child in node.children:
            if self.story.nodes[child].level in (Level.ACT, Level.EVENT):
                work.runs[child] = 0
                self._standby(work, child)
            else:
                work.runs[child] = 0
                self._start(work, child, ())

    def _act(self, work: Work, node: Node, who: tuple[int, ...]) -> None:
        group = self.story.nodes[self.story.nodes[node.parent].parent]
        actors = tuple(dict.fromkeys((*group.actors, *(who if group.actors_trigger else ()))))
        for child in node.children:
            action = self.story.nodes[child].action
            assert action is not None
            work.phases[child] = Phase.RUNNING
            work.marks.add((child, "startTransition"))
            for actor in actors or (-1,):
                if actor >= 0 or isinstance(action, ParameterAction | NoAction):
                    begin(work, child, action, actor)
                if isinstance(action, ParameterAction):
                    break  # once, whoever acts

    def _stop(self, work: Work, place: int) -> None:
        """Stop an element and all within it."""
        for child in self.story.nodes[place].children:
            if work.phases[child] in (Phase.RUNNING, Phase.STANDBY):
                self._stop(work, child)
        if self.story.nodes[place].level is Level.ACTION:
            for one in [one for one in work.running if one.node == place]:
                stop(work, one, self._action(one))
                work.running.remove(one)
        node = self.story.nodes[place]
        if (
            node.level is Level.EVENT
            and work.phases[node.parent] is Phase.RUNNING
            and work.runs[place] < node.most_runs
        ):
            work.marks.add((place, "stopTransition"))
            self._standby(work, place)
            return
        self._complete(work, place, "stopTransition")
        if node.level is Level.EVENT:
            work.marks.add((place, "endTransition"))

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
            if not isfinite(motion.s_m):
                raise StoryError(f"{self.story.path}: {self.story.entities[entity].name} drives to no number")
            corridor = self.tracks.corridor(body.track)
            if corridor.reaches(max(motion.s_m, 0.0) + CALM_M):
                fastest = max(body.speed.start_mps, body.speed.end_mps)
                if body.lateral.length == 0.0 and (body.lateral.end_m == 0.0 or fastest == 0.0):
                    self._calm[entity] = body, work.t_ns + int(CALM_M / max(fastest, 1.0) * 1e9)
            elif not corridor.reaches(max(motion.s_m, 0.0)):
                at_end = replace(body, t_ns=work.t_ns, s_m=corridor.length_m, is_ended=True)
                work.put(entity, replace(at_end, driven_m=motion.driven_m, follow=None))
                work.say(f"{self.story.entities[entity].name} comes to the end of its road")
