"""An OpenSCENARIO file into a Story: everything is read and checked once, nothing has moved."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from vsensor.errors import StoryError
from vsensor.world.opendrive.xml import Element, children, shortened
from vsensor.world.openscenario.action_data import Action, NoAction
from vsensor.world.openscenario.actions import read_global, read_private
from vsensor.world.openscenario.conditions import Conditions
from vsensor.world.openscenario.entities import Cast, read_entities
from vsensor.world.openscenario.model import LEVEL_NAMES, Level, Node, Story
from vsensor.world.openscenario.reader import StoryReader

PRIORITIES = {"overwrite": "overwrite", "override": "overwrite", "skip": "skip", "parallel": "parallel"}
MOST_RUNS = 1_000_000
NOTHING = NoAction("", False, "")
STATES = (
    *("startTransition", "endTransition", "stopTransition", "skipTransition"),
    *("completeState", "runningState", "standbyState"),
)


def load_story(path: Path | str, parameters: Mapping[str, str] | None = None, ego: str = "Ego") -> Story:
    """Read an OpenSCENARIO file (1.0 to 1.3); raises StoryError naming file, line, element.

    `parameters` stand in place of values that the file declares. What is not played is in the findings;
    what would move `ego` and is not played is refused.
    """
    reader = StoryReader(Path(path), parameters)
    root = reader.read()
    for one in children(root.find("VariableDeclarations"), "VariableDeclaration"):
        reader.parameters[reader.text(one, "name")] = one.get("value") or ""
    cast = read_entities(reader, root)
    if ego not in cast.places:
        known = ", ".join(cast.places) or "none"
        raise StoryError(f"{path}: no entity is named {ego}: --ego NAME says who carries the sensor: {known}")
    tree = _Tree(reader, cast)
    board = reader.child(root, "Storyboard")
    init = _init(reader, cast, board)
    for element in children(board, "Story"):
        tree.story(element)
    stop = tree.conditions.trigger(board.find("StopTrigger"))
    tree.find_elements()
    story = Story(
        path=str(path),
        road_file=_road_file(reader, root),
        entities=tuple(cast.entities),
        init=tuple(init),
        nodes=tuple(tree.nodes),
        conditions=tuple(tree.conditions.all),
        stop=stop,
        parameters=dict(reader.parameters),
        findings=tuple(dict.fromkeys(reader.warnings)),
        notes=tuple(cast.notes),
        catalogs=reader.files,
    )
    _refuse_for_ego(story, cast.places[ego])
    return story


def _road_file(reader: StoryReader, root: Element) -> str:
    network = reader.child(root, "RoadNetwork")
    return reader.text(reader.child(network, "LogicFile"), "filepath")


def _init(reader: StoryReader, cast: Cast, board: Element) -> list[tuple[int, Action]]:
    """Return the actions of <Init>, those that place somebody first, whatever the order in the file."""
    actions: list[tuple[int, Action]] = []
    for element in children(
        next(children(board.find("Init"), "Actions"), None), *("GlobalAction", "Private", "UserDefinedAction")
    ):
        if element.tag == "GlobalAction":
            actions.append((-1, read_global(reader, cast, element)))
        elif element.tag == "Private":
            actor = cast.of(reader, element)
            for private in children(element, "PrivateAction"):
                actions += [(actor, action) for action in read_private(reader, cast, private)]
        else:
            reader.warn(element, "has no effect: nobody here knows it")
    return actions


def _refuse_for_ego(story: Story, ego: int) -> None:
    """Raise StoryError for an action that would move the ego and is not played."""
    acting = [(actor, action) for actor, action in story.init]
    acting += [
        (actor, story.nodes[place].action or NOTHING)
        for node in story.nodes
        if node.level is Level.EVENT
        for actor in story.nodes[story.nodes[node.parent].parent].actors
        for place in node.children
    ]
    for actor, action in acting:
        if actor == ego and isinstance(action, NoAction) and action.moves:
            raise StoryError(f"{action.where}: not played, and it would move {story.entities[ego].name}")


class _Tree:
    """Reads the tree of stories into a row of nodes, parents before their children."""

    def __init__(self, reader: StoryReader, cast: Cast) -> None:
        self._reader = reader
        self._cast = cast
        self.conditions = Conditions(reader, cast)
        self.nodes: list[Node] = []

    def story(self, element: Element) -> None:
        """Read a <Story>."""
        place = self._add(Node(level=Level.STORY, name=self._name(element), parent=-1))
        self._fill(place, [self._act(one, place) for one in children(element, "Act")])

    def _act(self, element: Element, parent: int) -> int:
        start = self.conditions.trigger(element.find("StartTrigger"))
        stop = self.conditions.trigger(element.find("StopTrigger"))
        place = self._add(
            Node(level=Level.ACT, name=self._name(element), parent=parent, start=start, stop=stop)
        )
        groups = [self._group(one, place) for one in children(element, "ManeuverGroup")]
        return self._fill(place, groups)

    def _group(self, element: Element, parent: int) -> int:
        actors = self._reader.child(element, "Actors")
        place = self._add(
            Node(
                level=Level.GROUP,
                name=self._name(element),
                parent=parent,
                most_runs=self._runs(element),
                actors=tuple(self._cast.of(self._reader, one) for one in children(actors, "EntityRef")),
                actors_trigger=self._reader.boolean(actors, "selectTriggeringEntities", default=False),
            )
        )
        return self._fill(place, [self._maneuver(one, place) for one in children(element, "Maneuver")])

    def _maneuver(self, element: Element, parent: int) -> int:
        place = self._add(Node(level=Level.MANEUVER, name=self._name(element), parent=parent))
        return self._fill(place, [self._event(one, place) for one in children(element, "Event")])

    def _event(self, element: Element, parent: int) -> int:
        start = self.conditions.trigger(element.find("StartTrigger"))
        place = self._add(
            Node(
                level=Level.EVENT,
                name=self._name(element),
                parent=parent,
                start=start,
                most_runs=self._runs(element),
                priority=PRIORITIES[self._reader.choice(element, "priority", tuple(PRIORITIES))],
            )
        )
        found = [k for one in children(element, "Action") for k in self._actions(one, place)]
        if not found:
            raise self._reader.error(element, "<Action> is missing")
        return self._fill(place, found)

    def _actions(self, element: Element, parent: int) -> list[int]:
        inner = self._reader.child(element, "PrivateAction", "GlobalAction", "UserDefinedAction")
        name = self._name(element)
        if inner.tag == "PrivateAction":
            actions = read_private(self._reader, self._cast, inner)
        elif inner.tag == "GlobalAction":
            actions = [read_global(self._reader, self._cast, inner)]
        else:
            self._reader.warn(inner, "has no effect: nobody here knows it")
            actions = [NoAction(inner.tag, False, "")]
        return [
            self._add(Node(level=Level.ACTION, name=name, parent=parent, action=action)) for action in actions
        ]

    def _add(self, node: Node) -> int:
        self.nodes.append(node)
        return len(self.nodes) - 1

    def _fill(self, place: int, inner: list[int]) -> int:
        self.nodes[place] = replace(self.nodes[place], children=tuple(inner))
        return place

    def _name(self, element: Element) -> str:
        return " ".join((element.get("name") or "").split())

    def _runs(self, element: Element) -> int:
        if element.get("maximumExecutionCount") is None:
            return 1
        runs = self._reader.integer(element, "maximumExecutionCount")
        if not 0 <= runs <= MOST_RUNS:
            raise self._reader.error(element, f'maximumExecutionCount="{runs}": 0 to 1000000 was expected')
        return runs

    def find_elements(self) -> None:
        """Fill in the elements whose state conditions ask for; raises StoryError for names of none."""
        reader = self._reader
        for place, element in self.conditions.asked:
            level = LEVEL_NAMES[reader.choice(element, "storyboardElementType", tuple(LEVEL_NAMES))]
            wanted = reader.text(element, "storyboardElementRef")
            name = wanted.split("::")[-1]
            found = tuple(k for k, n in enumerate(self.nodes) if n.level is level and n.name == name)
            if not found:
                known = ", ".join(n.name for n in self.nodes if n.level is level) or "none"
                raise reader.error(
                    element,
                    f'storyboardElementRef="{shortened(wanted)}": no such element; there are: {known}',
                )
            state = self.conditions.all[place].state
            if state not in STATES:
                raise reader.error(element, f'state="{shortened(state)}": {" or ".join(STATES)} was expected')
            self.conditions.all[place] = replace(self.conditions.all[place], elements=found)
