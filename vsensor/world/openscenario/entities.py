"""Entities of a scenario: vehicles with their trailers, pedestrians, things that stand."""

from dataclasses import dataclass, field, replace
from typing import Any

from vsensor.world.opendrive.xml import Element, children
from vsensor.world.openscenario.model import Box, Entity
from vsensor.world.openscenario.reader import StoryReader

MOST_ENTITIES = 1000
LARGEST_M = 1000.0
KINDS = ("Vehicle", "Pedestrian", "MiscObject")


@dataclass
class Cast:
    """The entities read so far; a trailer has its vehicle's name and a plus sign for each one before it."""

    entities: list[Entity] = field(default_factory=list[Entity])
    places: dict[str, int] = field(default_factory=dict[str, int])
    notes: list[str] = field(default_factory=list[str])

    def add(self, reader: StoryReader, element: Element, entity: Entity) -> int:
        """Return the place of a new entity."""
        if entity.name in self.places:
            raise reader.error(element, f"two entities are named {entity.name}")
        if len(self.entities) >= MOST_ENTITIES:
            raise reader.error(element, f"more than {MOST_ENTITIES} entities")
        self.places[entity.name] = len(self.entities)
        self.entities.append(entity)
        return self.places[entity.name]

    def of(self, reader: StoryReader, element: Element, attribute: str = "entityRef") -> int:
        """Return the place of the entity that an attribute names."""
        name = reader.text(element, attribute)
        if name not in self.places:
            known = ", ".join(list(self.places)[:20]) or "none"
            raise reader.error(element, f'{attribute}="{name}": no such entity; there are: {known}')
        return self.places[name]


def read_entities(reader: StoryReader, root: Element) -> Cast:
    """Return the scenario's entities, the trailers after them; raises StoryError."""
    cast = Cast()
    bodies: list[tuple[int, Element]] = []
    section = reader.child(root, "Entities")
    for element in children(section, "ScenarioObject"):
        name = reader.text(element, "name")
        body = next(children(element, *KINDS), None)
        if body is None:
            raise reader.error(element, f"{name} is no vehicle, pedestrian or object: <Vehicle> was expected")
        bodies.append((cast.add(reader, element, _entity(reader, body, name)), body))
        _note_controller(cast, element, name)
    for element in section.iterchildren("EntitySelection"):
        reader.warn(element, "selections of entities are not played")
    for place, body in bodies:
        _draw(reader, cast, place, body)
    return cast


def _note_controller(cast: Cast, element: Element, name: str) -> None:
    for controller in children(element, "ObjectController"):
        for one in controller.iterchildren("Controller"):
            cast.notes.append(
                f"{name}: controller {one.get('name')} is replaced: it follows its lane and the storyboard"
            )


def _entity(reader: StoryReader, body: Element, name: str) -> Entity:
    category = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}.get(
        body.tag, "miscObjectCategory"
    )
    box = _box(reader, reader.child(body, "BoundingBox"))
    front = next(children(body.find("Axles"), "FrontAxle"), None)
    performance = body.find("Performance")
    limits: dict[str, Any] = {}
    if performance is not None:
        limits = {
            "max_speed_mps": reader.at_least(performance, "maxSpeed", 0.0),
            "max_acceleration_mps2": reader.at_least(performance, "maxAcceleration", 0.0),
            "max_deceleration_mps2": reader.at_least(performance, "maxDeceleration", 0.0),
        }
    return Entity(
        name=name,
        kind=body.tag,
        category=str(body.get(category, "")),
        box=box,
        wheelbase_m=0.0 if front is None else reader.number(front, "positionX", 0.0),
        hitch_m=_along(reader, body, "TrailerHitch"),
        coupler_m=_along(reader, body, "TrailerCoupler"),
        **limits,
    )


def _along(reader: StoryReader, body: Element, tag: str) -> float | None:
    found = body.find(tag)
    return None if found is None else reader.number(found, "dx")


def _box(reader: StoryReader, element: Element) -> Box:
    centre, size = reader.child(element, "Center"), reader.child(element, "Dimensions")
    sizes = [reader.at_least(size, name, 0.0) for name in ("length", "width", "height")]
    if max(sizes) > LARGEST_M:
        raise reader.error(size, f"at most {LARGEST_M:g} m were expected")
    x, y, z = (reader.number(centre, name) for name in "xyz")
    return Box((x, y, z), (sizes[0], sizes[1], sizes[2]))


def _draw(reader: StoryReader, cast: Cast, place: int, body: Element) -> None:
    """Hang the trailer that a vehicle names or brings behind it, and that one's own."""
    trailer = body.find("Trailer")
    if trailer is None:
        return
    reference = trailer.find("TrailerRef")
    if reference is not None:
        if not (reference.get("entityRef") or "").strip():  # esmini's catalogs: none is drawn
            return
        drawn, inner = cast.of(reader, reference), None
    else:
        inner = next((v for t in children(trailer, "Trailer") for v in children(t, "Vehicle")), None)
        if inner is None:
            inner = next(children(trailer, "Vehicle"), None)
        if inner is None:
            return
        drawn = cast.add(reader, inner, _entity(reader, inner, f"{cast.entities[place].name}+"))
    owner, other = cast.entities[place], cast.entities[drawn]
    if drawn == place or other.drawn_by is not None:
        raise reader.error(trailer, f"{other.name} is drawn by two vehicles, or by itself")
    if other.coupler_m is None:
        raise reader.error(trailer, f"{other.name} has no <TrailerCoupler>")
    hitch_m = owner.hitch_m if owner.hitch_m is not None else owner.box.centre_m[0] - owner.box.size_m[0] / 2
    if other.coupler_m <= 0.0:
        raise reader.error(trailer, f"{other.name}: its <TrailerCoupler> must be ahead of its axle")
    cast.entities[place] = replace(owner, trailer=drawn, hitch_m=hitch_m)
    cast.entities[drawn] = replace(other, drawn_by=place)
    if inner is not None:
        _draw(reader, cast, drawn, inner)
