"""Body motion and vibration joined: from acceleration and driven way to where the body stands."""

from dataclasses import dataclass, replace
from math import isfinite, radians, sin
from pathlib import Path

from vsensor.draws import Draws, Stage
from vsensor.errors import ConfigError
from vsensor.motion.config import MotionConfig
from vsensor.motion.mode import NANOSECONDS_PER_SECOND, Mode, ring
from vsensor.motion.recording import Recording, load_recording
from vsensor.motion.swell import lifted, swell_height_m
from vsensor.motion.swells import Swells
from vsensor.motion.vibration import NORMALS, Vibration
from vsensor.schema import user_path
from vsensor.types import EgoState, Swell, Tick, Unevenness


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The motion model compiled: modes of the body, bumps, and what shakes it (None: nothing)."""

    body: bool
    pitch_gain: float
    roll_gain: float
    pitch: Mode
    roll: Mode
    heave: Mode
    bumps: Swells
    wheelbase_m: float
    noise: Vibration | None
    recording: Recording | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionState:
    """What is remembered from tick to tick: driven way, last speed and forces, modes, the noise's state.

    `t_ns` is the last tick's time, -1 before the first one. `pitch`, `roll`, `heave` are the modes'
    complex amplitudes, without the settled part of the forces (rad). `road_m` is where the rear axle was
    along the way of the road's unevenness, None where that was even.
    """

    t_ns: int = -1
    driven_m: float = 0.0
    speed_mps: float = 0.0
    pitch_force: float = 0.0
    roll_force: float = 0.0
    pitch: complex = 0j
    roll: complex = 0j
    heave: complex = 0j
    noise: tuple[float, ...] = ()
    road_m: float | None = None


def load_motion(config: MotionConfig, wheelbase_m: float = 2.8, folder: Path = Path()) -> Motion | None:
    """Compile `[motion]`; None if nothing of it is switched on. Raises ConfigError."""
    if config.bumps and not config.body:
        raise ConfigError("motion.bumps: they need the body's springs: motion.body = true")
    if config.vibration_file is not None and config.vibration != "none":
        raise ConfigError("motion.vibration_file: either a file or motion.vibration, not both")
    recording = None
    if config.vibration_file is not None:
        recording = load_recording(folder / user_path(config.vibration_file))
    noise = Vibration.of(config)
    if not config.body and noise is None and recording is None:
        return None
    return Motion(
        body=config.body,
        pitch_gain=-_radians(config.pitch_deg_per_mps2),  # braking is a < 0, nose down is positive
        roll_gain=_radians(config.roll_deg_per_mps2),  # in a bend to the left the left side rises
        pitch=Mode.of(config.pitch_hz, config.damping),
        roll=Mode.of(config.roll_hz, config.damping),
        heave=Mode.of(config.heave_hz, config.damping),
        bumps=Swells.of_bumps(config.bumps),
        wheelbase_m=wheelbase_m,
        noise=noise,
        recording=recording,
    )


def _radians(gain_deg: float | str) -> float:
    if isinstance(gain_deg, str):
        raise ConfigError(
            f'motion: a gain of "{gain_deg}" needs a scenario\'s [dynamics]; a number was expected'
        )
    return radians(gain_deg)


def initial_state() -> MotionState:
    """Return the state before the first tick."""
    return MotionState()


def advance(
    motion: Motion, state: MotionState, ego: EgoState, draws: Draws, tick: Tick
) -> tuple[MotionState, EgoState]:
    """Move the body to the time of `tick`; return the ego with this motion added to its own.

    Speed and accelerations count as linear since the last tick, over a bump the speed as constant. The
    first tick finds the body settled and the noise stationary. Values that are not finite: the last
    ones hold. The body pitches about the middle between the axles.
    """
    begins = tick.t_ns <= state.t_ns or state.t_ns < 0
    period_ns = 0 if begins else tick.t_ns - state.t_ns
    noise = _noise(motion, state.noise, draws, tick, period_ns)
    if motion.body:
        state = _settled(motion, ego) if begins else _moved(motion, state, ego, period_ns)
    state = replace(state, t_ns=tick.t_ns, noise=noise)
    pitch, roll, heave = _shaken(motion, noise, tick)
    pitch += state.pitch_force + state.pitch.real
    roll += state.roll_force + state.roll.real
    heave += state.heave.real + 0.5 * motion.wheelbase_m * sin(pitch)  # the origin is at the rear axle
    return state, replace(
        ego,
        body_pitch_rad=ego.body_pitch_rad + pitch,
        body_roll_rad=ego.body_roll_rad + roll,
        body_heave_m=ego.body_heave_m + heave,
    )


def _noise(
    motion: Motion, noise: tuple[float, ...], draws: Draws, tick: Tick, period_ns: int
) -> tuple[float, ...]:
    if motion.noise is None:
        return ()
    normals = draws.at(Stage.CAMERA, tick.index).standard_normal(NORMALS).tolist()
    if not period_ns:
        return motion.noise.start(normals)
    return motion.noise.advance(noise, period_ns, normals)


def _shaken(motion: Motion, noise: tuple[float, ...], tick: Tick) -> tuple[float, float, float]:
    if motion.recording is not None:
        return motion.recording.motion(tick.t_ns)
    return (0.0, 0.0, 0.0) if motion.noise is None else motion.noise.motion(noise)


def _settled(motion: Motion, ego: EgoState) -> MotionState:
    """Return the state of a body that has been moving like this for long."""
    rear_m, swells = _under(ego.uneven)
    pitch, heave = _standing(motion, 0.0, motion.bumps.near(0.0, motion.wheelbase_m))
    on_road = _standing(motion, rear_m or 0.0, swells)
    return MotionState(
        speed_mps=_known(ego.speed_mps, 0.0),
        pitch_force=motion.pitch_gain * _known(ego.acceleration_mps2, 0.0),
        roll_force=motion.roll_gain * _known(ego.lateral_acceleration_mps2, 0.0),
        pitch=pitch + on_road[0],
        heave=heave + on_road[1],
        road_m=rear_m,
    )


def _moved(motion: Motion, state: MotionState, ego: EgoState, period_ns: int) -> MotionState:
    """Return the body's state a tick later."""
    speed = _known(ego.speed_mps, state.speed_mps)
    pitch_force, roll_force = state.pitch_force, state.roll_force
    if isfinite(ego.acceleration_mps2):
        pitch_force = motion.pitch_gain * ego.acceleration_mps2
    if isfinite(ego.lateral_acceleration_mps2):
        roll_force = motion.roll_gain * ego.lateral_acceleration_mps2
    pitch = ring(motion.pitch, state.pitch, pitch_force - state.pitch_force, period_ns)
    heave = ring(motion.heave, state.heave, 0.0, period_ns)
    way_m = 0.5 * (state.speed_mps + speed) * (period_ns / NANOSECONDS_PER_SECOND)
    bumps = motion.bumps.near(*_touched(motion, state.driven_m, way_m))
    road_m, swells = _under(ego.uneven)
    lifts = [_lifted(motion, state.driven_m, way_m, bumps, period_ns)]
    if state.road_m is not None and road_m is not None and _goes_on(state.road_m, road_m, way_m):
        lifts.append(_lifted(motion, state.road_m, road_m - state.road_m, swells, period_ns))
    pitch, heave = pitch + sum(lift[0] for lift in lifts), heave + sum(lift[1] for lift in lifts)
    return MotionState(
        driven_m=state.driven_m + way_m,
        speed_mps=speed,
        pitch_force=pitch_force,
        roll_force=roll_force,
        pitch=pitch,
        roll=ring(motion.roll, state.roll, roll_force - state.roll_force, period_ns),
        heave=heave,
        road_m=road_m,
    )


def _under(uneven: Unevenness | None) -> tuple[float | None, tuple[Swell, ...]]:
    """Return where the rear axle is along the way of the road's unevenness, and the swells there."""
    return (None, ()) if uneven is None else (uneven.rear_axle_m, uneven.swells)


def _goes_on(before_m: float, now_m: float, way_m: float) -> bool:
    """Return whether a vehicle drove from one place of the road to the other: it was not put there."""
    return abs(now_m - before_m) <= 2.0 * abs(way_m) + 0.1


def _touched(motion: Motion, rear_m: float, way_m: float) -> tuple[float, float]:
    """Return from where to where the axles roll."""
    front_m = rear_m + motion.wheelbase_m
    return min(rear_m, rear_m + way_m), max(front_m, front_m + way_m)


def _standing(motion: Motion, rear_m: float, swells: tuple[Swell, ...]) -> tuple[complex, complex]:
    """Return pitch and heave of a body whose axles have stood on the swells for long."""
    pitch = heave = 0j
    for swell in swells:
        front, rear = swell_height_m(swell, rear_m + motion.wheelbase_m), swell_height_m(swell, rear_m)
        pitch -= motion.pitch.foot / motion.pitch.pole * (rear - front) / motion.wheelbase_m
        heave -= motion.heave.foot / motion.heave.pole * (rear + front) / 2.0
    return pitch, heave


def _lifted(
    motion: Motion, rear_m: float, way_m: float, swells: tuple[Swell, ...], period_ns: int
) -> tuple[complex, complex]:
    """Return what swells add to pitch and heave in a tick in which the axles roll evenly on by `way_m`."""
    pitch = heave = 0j
    speed_mps, wheelbase_m = way_m * (NANOSECONDS_PER_SECOND / period_ns), motion.wheelbase_m
    for swell in swells:
        for axle_m, lever_m in ((rear_m, wheelbase_m), (rear_m + wheelbase_m, -wheelbase_m)):
            pitch += lifted(motion.pitch, swell, axle_m, speed_mps, period_ns) / lever_m
            heave += lifted(motion.heave, swell, axle_m, speed_mps, period_ns) / 2.0
    return pitch, heave


def _known(value: float, otherwise: float) -> float:
    return value if isfinite(value) else otherwise
