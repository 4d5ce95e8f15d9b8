"""The boxes of all entities at one time, their poses made in one go: 50 vehicles in some 0.3 ms."""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, Obstacle, frozen
from vsensor.world.openscenario.bodies import Motion, spot_of
from vsensor.world.openscenario.work import Work


@dataclass(frozen=True, slots=True)
class Axes:
    """Position and axes (N, 3) of entities: forward, left, up of the road turned into their heading."""

    position: Array
    forward: Array
    left: Array
    up: Array

    def angles(self) -> tuple[Array, Array, Array]:
        """Return roll, pitch, yaw (N,) as for EgoState."""
        roll = np.arctan2(self.left[:, 2], self.up[:, 2])
        pitch = np.arctan2(-self.forward[:, 2], np.hypot(self.forward[:, 0], self.forward[:, 1]))
        return roll, pitch, np.arctan2(self.forward[:, 1], self.forward[:, 0])


def axes_of(work: Work, entities: list[int], motions: list[Motion]) -> Axes:
    """Return position and axes of entities that are on their tracks, or off them by a pose of their own."""
    rows = np.empty((len(entities), 4, 10))
    place = np.empty((4, len(entities)))
    for k, (entity, motion) in enumerate(zip(entities, motions, strict=True)):
        body = work.bodies[entity]
        assert body is not None
        rows[k], share, beyond = work.tracks.corridor(body.track).row(motion.s_m)
        place[:, k] = share, beyond, motion.offset_m, spot_of(body, motion).turn_rad
    x, over, offset, turn = place
    h = x[:, None]
    row = rows[:, 0] + h * (rows[:, 1] + h * (rows[:, 2] + h * rows[:, 3]))
    lane, left = row[:, 3:6], row[:, 6:9]
    position = row[:, 0:3] + over[:, None] * lane + offset[:, None] * left
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    axes = Axes(position, c * lane + s * left, c * left - s * lane, np.cross(lane, left))
    for k, entity in enumerate(entities):
        if work.has_own_pose(entity):
            _put_pose(work, axes, k, entity)
    return axes


def _put_pose(work: Work, axes: Axes, k: int, entity: int) -> None:
    """Put in the pose of a trailer or of one on a trajectory: level, but for a trailer's slope."""
    pose = work.pose(entity)
    assert pose is not None
    point, heading = pose
    drawn = work.rod(entity)
    rise = 0.0 if drawn is None else drawn[0].rise
    run = np.sqrt(max(1.0 - rise * rise, 0.0))
    axes.position[k] = point
    axes.forward[k] = np.cos(heading) * run, np.sin(heading) * run, rise
    axes.left[k] = -np.sin(heading), np.cos(heading), 0.0
    axes.up[k] = np.cross(axes.forward[k], axes.left[k])


def boxes_near(
    work: Work, centre: Array, radius_m: float, stands: dict[int, Obstacle]
) -> tuple[Obstacle, ...]:
    """Return the boxes of all but the sensor's carrier and its trailers that reach within a radius.

    `stands` holds those of things that stand, the same objects from tick to tick.
    """
    entities, motions = [], []
    for entity in range(len(work.bodies)):
        if work.leader(entity) != work.ego or entity != work.ego:
            motion = None if work.bodies[entity] is None else work.motion(entity)
            if motion is not None:
                entities.append(entity)
                motions.append(motion)
    if not entities:
        return ()
    axes = axes_of(work, entities, motions)
    boxes = [work.story.entities[entity].box for entity in entities]
    local = np.array([box.centre_m for box in boxes])
    middle = (
        axes.position + local[:, 0:1] * axes.forward + local[:, 1:2] * axes.left + local[:, 2:3] * axes.up
    )
    reach = np.array([max(box.size_m) for box in boxes])
    near = np.hypot(middle[:, 0] - centre[0], middle[:, 1] - centre[1]) - reach <= radius_m
    roll, pitch, yaw = (angle.tolist() for angle in axes.angles())
    found = []
    for k in near.nonzero()[0].tolist():
        entity = entities[k]
        still = work.story.entities[entity].kind == "MiscObject" and motions[k].speed_mps == 0.0
        known = stands.get(entity) if still else None
        if known is not None and (known.centre_world_m == middle[k]).all() and known.yaw_rad == yaw[k]:
            found.append(known)
            continue
        made = Obstacle(
            id=entity,
            centre_world_m=frozen(middle[k]),
            size_m=boxes[k].size_m,
            roll_rad=roll[k],
            pitch_rad=pitch[k],
            yaw_rad=yaw[k],
            is_moving=not still,
        )
        if still:
            stands[entity] = made
        found.append(made)
    return tuple(found)
