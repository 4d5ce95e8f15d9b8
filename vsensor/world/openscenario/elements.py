"""The tree of the storyboard at one step: which elements end, which start, until nothing changes any more.

IDLE --> STANDBY --trigger--> RUNNING --all within it is done--> COMPLETE
          ^---- an event that may run again ----'
"""

from vsensor.world.openscenario.acting import begin, is_done, stop
from vsensor.world.openscenario.action_data import Action, NoAction, ParameterAction
from vsensor.world.openscenario.following import keep_in_step
from vsensor.world.openscenario.model import Level, Node
from vsensor.world.openscenario.state import Memory, Phase, Running
from vsensor.world.openscenario.towing import tow
from vsensor.world.openscenario.triggers import trigger_value
from vsensor.world.openscenario.work import Work

MOST_PASSES = 64
"""Elements that start each other within one step, at most so many times around."""


def _action(work: Work, one: Running) -> Action:
    if one.node < 0:
        return work.story.init[-2 - one.node][1]
    action = work.story.nodes[one.node].action
    assert action is not None
    return action


def play(work: Work) -> None:
    """End what is done, start what is triggered, until nothing changes any more."""
    for _ in range(MOST_PASSES):
        before = len(work.marks), len(work.running)
        _end_actions(work)
        _end_elements(work)
        _triggers(work)
        if before == (len(work.marks), len(work.running)):
            break
    keep_in_step(work)
    tow(work)


def _end_actions(work: Work) -> None:
    for one in list(work.running):
        if is_done(work, one, _action(work, one)):
            work.running.remove(one)


def _end_elements(work: Work) -> None:
    """Complete, from actions up to stories, what has nothing left to do."""
    going = {one.node for one in work.running}
    nodes = work.story.nodes
    for place in range(len(nodes) - 1, -1, -1):
        if work.phases[place] is not Phase.RUNNING:
            continue
        node = nodes[place]
        if node.level is Level.ACTION:
            if place not in going:
                _complete(work, place, "endTransition")
        elif all(work.phases[child] is Phase.COMPLETE for child in node.children):
            _run_over(work, place, node)


def _run_over(work: Work, place: int, node: Node) -> None:
    """End one execution; an event or group that may run again goes back to where it waits."""
    if node.level in (Level.EVENT, Level.GROUP) and work.runs[place] < node.most_runs:
        work.marks.add((place, "endTransition"))
        if node.level is Level.GROUP and node.children:
            start(work, place)
        elif node.level is Level.EVENT:
            _standby(work, place)
        else:
            _complete(work, place, "endTransition")
    else:
        _complete(work, place, "endTransition")


def _complete(work: Work, place: int, mark: str) -> None:
    work.phases[place] = Phase.COMPLETE
    work.marks.add((place, mark))
    node = work.story.nodes[place]
    if node.level is Level.EVENT:
        work.say(f"event {node.name} ends")


def _standby(work: Work, place: int) -> None:
    work.phases[place] = Phase.STANDBY
    node = work.story.nodes[place]
    for trigger in (node.start, node.stop):
        for group in trigger.groups if trigger else ():
            work.fresh.update(group)
            for condition in group:
                work.memories[condition] = Memory()


def _triggers(work: Work) -> None:
    """Look at the triggers of everything that waits or may be stopped."""
    for place, node in enumerate(work.story.nodes):
        if node.level is Level.ACT and work.phases[place] is Phase.RUNNING and node.stop is not None:
            if trigger_value(work, node.stop)[0]:
                _stop(work, place)
        elif work.phases[place] is Phase.STANDBY:
            fired, who = trigger_value(work, node.start)
            if (fired or node.start is None) and _parent_runs(work, node):
                _fire(work, place, who)


def _parent_runs(work: Work, node: Node) -> bool:
    return node.parent < 0 or work.phases[node.parent] is Phase.RUNNING


def _fire(work: Work, place: int, who: tuple[int, ...]) -> None:
    """Start an act or an event that was triggered, as its priority has it."""
    node = work.story.nodes[place]
    if node.level is Level.EVENT:
        others = [
            other
            for other in work.story.nodes[node.parent].children
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
                _stop(work, other)
    start(work, place, who)


def start(work: Work, place: int, who: tuple[int, ...] = ()) -> None:
    """Begin one execution of an element; acts and events within wait for their triggers."""
    node = work.story.nodes[place]
    if node.level in (Level.EVENT, Level.GROUP) and node.most_runs == 0:
        work.phases[place] = Phase.COMPLETE
        return
    work.phases[place] = Phase.RUNNING
    work.runs[place] += 1
    work.marks.add((place, "startTransition"))
    if node.level is Level.EVENT:
        work.say(f"event {node.name} starts")
        _act(work, node, who)
        return
    for child in node.children:
        if work.story.nodes[child].level in (Level.ACT, Level.EVENT):
            work.runs[child] = 0
            _standby(work, child)
        else:
            work.runs[child] = 0
            start(work, child)


def _act(work: Work, node: Node, who: tuple[int, ...]) -> None:
    group = work.story.nodes[work.story.nodes[node.parent].parent]
    actors = tuple(dict.fromkeys((*group.actors, *(who if group.actors_trigger else ()))))
    for child in node.children:
        action = work.story.nodes[child].action
        assert action is not None
        work.phases[child] = Phase.RUNNING
        work.marks.add((child, "startTransition"))
        for actor in actors or (-1,):
            if actor >= 0 or isinstance(action, ParameterAction | NoAction):
                begin(work, child, action, actor)
            if isinstance(action, ParameterAction):
                break  # once, whoever acts


def _stop(work: Work, place: int) -> None:
    """Stop an element and all within it."""
    for child in work.story.nodes[place].children:
        if work.phases[child] in (Phase.RUNNING, Phase.STANDBY):
            _stop(work, child)
    if work.story.nodes[place].level is Level.ACTION:
        for one in [one for one in work.running if one.node == place]:
            stop(work, one, _action(work, one))
            work.running.remove(one)
    node = work.story.nodes[place]
    if (
        node.level is Level.EVENT
        and work.phases[node.parent] is Phase.RUNNING
        and work.runs[place] < node.most_runs
    ):
        work.marks.add((place, "stopTransition"))
        _standby(work, place)
        return
    _complete(work, place, "stopTransition")
    if node.level is Level.EVENT:
        work.marks.add((place, "endTransition"))
