"""Trailers: boxes of their own, each drawn at its coupler by the hitch of what is before it."""

from msgspec.structs import replace

from vsensor.world.openscenario.bodies import Body
from vsensor.world.openscenario.rods import Rod
from vsensor.world.openscenario.work import Work

TOW_NS = 40_000_000
"""So often the pull is taken as straight: 1.2 m at 108 km/h."""


def hang(work: Work, entity: int) -> None:
    """Put the trailers behind a vehicle, straight behind each other along its way."""
    body, spot = work.body(entity), work.spot(entity)
    if body is None or spot is None:
        return
    _, heading = work.tracks.pose(spot)
    while (trailer := work.story.entities[entity].trailer) is not None:
        rod = Rod(work.hitch(entity), heading)
        work.put(trailer, Body(track=body.track, t_ns=work.t_ns, s_m=body.s_m, rod=rod))
        entity = trailer


def tow(work: Work) -> None:
    """Draw the trailers along, every so many steps."""
    if work.t_ns % TOW_NS:
        return
    for entity, one in enumerate(work.story.entities):
        if one.trailer is not None and one.drawn_by is None and work.body(entity) is not None:
            _tow_behind(work, entity)


def _tow_behind(work: Work, entity: int) -> None:
    while (trailer := work.story.entities[entity].trailer) is not None:
        body, drawn = work.body(trailer), work.rod(trailer)
        if body is None or drawn is None:
            return
        work.put(trailer, replace(body, rod=drawn[0], t_ns=work.t_ns))
        entity = trailer
