"""Scenario files: one TOML composed of each module's own section."""

from pathlib import Path
from typing import Annotated, Any

import msgspec

from vsensor.camera import CameraConfig
from vsensor.error_model import ErrorModelConfig
from vsensor.errors import ConfigError
from vsensor.faults import FaultConfig
from vsensor.image import ImageConfig
from vsensor.lanefit import LaneFitConfig
from vsensor.motion import MotionConfig
from vsensor.quality import QualityConfig
from vsensor.region import RegionConfig
from vsensor.scene import SceneConfig
from vsensor.schema import Config, check_schema, convert, read_toml, user_path
from vsensor.sensor import SensorConfig
from vsensor.signals import VehicleConfig
from vsensor.sources import LOG_SUFFIXES, MAP_SUFFIXES, STORY_SUFFIXES
from vsensor.sources.departing import DepartureConfig
from vsensor.sources.drive import DriveConfig
from vsensor.sources.listening import ListenConfig
from vsensor.sources.map_drive import EgoConfig
from vsensor.sources.standing import ObstacleConfig
from vsensor.sources.storyboard import StoryboardConfig
from vsensor.sources.traffic import TrafficConfig
from vsensor.sources.weather import EnvironmentConfig
from vsensor.state import StateConfig
from vsensor.tracker import TrackerConfig
from vsensor.world.laid_road import LaidRoadConfig
from vsensor.world.road import is_road_file
from vsensor.world.vehicle import DriverConfig, DynamicsConfig, lean_degpmps2

SCHEMA = "vsensor.scenario/1"
CAMERA_SCHEMA = "vsensor.camera/1"
SHIPPED = Path(__file__).parent / "scenarios"
DEFAULT_SCENARIO = "highway"
SOURCE_SUFFIXES = (*MAP_SUFFIXES, *STORY_SUFFIXES, *LOG_SUFFIXES)


class BusConfig(Config, frozen=True, kw_only=True):
    """`[output]`: the profile that the frames follow, and the database it maps (shipped ones need none).

    `latency_ms` from the exposure of an image to its first frame on the bus.
    """

    profile: str = "native"
    dbc: str | None = None
    latency_ms: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 0.0


class ScenarioConfig(Config, frozen=True, kw_only=True):
    """A scenario: where the truth comes from, the sensor, and what goes out."""

    source: str
    name: str = ""
    camera_file: str | None = None
    duration_s: Annotated[float, msgspec.Meta(gt=0, le=31_536_000)] | None = None
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)] = 0
    cycle_ms: Annotated[int, msgspec.Meta(ge=5, le=1000)] = 40
    ego: EgoConfig = EgoConfig()
    traffic: tuple[TrafficConfig, ...] = ()
    obstacle: tuple[ObstacleConfig, ...] = ()
    environment: EnvironmentConfig = EnvironmentConfig()
    listen: ListenConfig = ListenConfig()
    dynamics: DynamicsConfig = DynamicsConfig()
    departure: DepartureConfig = DepartureConfig()
    driver: DriverConfig = DriverConfig()
    drive: DriveConfig = DriveConfig()
    road: LaidRoadConfig = LaidRoadConfig()
    storyboard: StoryboardConfig = StoryboardConfig()
    vehicle: VehicleConfig = VehicleConfig()
    camera: CameraConfig = CameraConfig()
    motion: MotionConfig = MotionConfig()
    scene: SceneConfig = SceneConfig()
    region: RegionConfig = RegionConfig()
    error_model: ErrorModelConfig = ErrorModelConfig()
    fit: LaneFitConfig = LaneFitConfig()
    tracker: TrackerConfig = TrackerConfig()
    quality: QualityConfig = QualityConfig()
    state: StateConfig = StateConfig()
    image: ImageConfig = ImageConfig()
    output: BusConfig = BusConfig()
    fault: tuple[FaultConfig, ...] = ()

    def sensor(self) -> SensorConfig:
        """Return the sections that make up the sensor."""
        return SensorConfig(
            camera=self.camera,
            motion=self._motion(),
            scene=self.scene,
            region=self.region,
            error_model=self.error_model,
            fit=self.fit,
            tracker=self.tracker,
            quality=self.quality,
            wheelbase_m=self.vehicle.wheelbase_m,
        )

    def _motion(self) -> MotionConfig:
        """Return the body's motion, its gains from masses and springs where it asks for them."""
        motion = self.motion
        if "dynamics" not in (motion.pitch_deg_per_mps2, motion.roll_deg_per_mps2):
            return motion
        pitch, roll = lean_degpmps2(self.dynamics, self.vehicle.wheelbase_m)
        return msgspec.structs.replace(
            motion,
            pitch_deg_per_mps2=pitch
            if motion.pitch_deg_per_mps2 == "dynamics"
            else motion.pitch_deg_per_mps2,
            roll_deg_per_mps2=roll if motion.roll_deg_per_mps2 == "dynamics" else motion.roll_deg_per_mps2,
        )


class CameraFileConfig(Config, frozen=True, kw_only=True):
    """A camera file: what a calibration finds, and the vehicle that the camera is on."""

    camera: CameraConfig
    vehicle: VehicleConfig = VehicleConfig()


class Scenario(msgspec.Struct, frozen=True, kw_only=True):
    """A scenario and the folder that its relative paths start from."""

    config: ScenarioConfig
    folder: Path
    path: Path | None = None

    def file(self, name: str) -> Path:
        """Return the path of a file that the scenario names."""
        return self.folder / user_path(name)

    @property
    def source(self) -> Path:
        """Return the path of the map or log that the drive comes from."""
        return self.file(self.config.source)

    @property
    def name(self) -> str:
        """Return the scenario's name, its file's stem if it has none."""
        return self.config.name or (self.path or self.source).stem


def load_scenario(name_or_path: str | None = None, overrides: dict[str, Any] | None = None) -> Scenario:
    """Load a shipped scenario by name, a scenario file, or a bare map, road, storyboard or log as it is.

    `overrides` are top-level keys that the command line sets. Raises ConfigError naming file and key.
    """
    path = _find(DEFAULT_SCENARIO if name_or_path is None else name_or_path)
    if _is_source(path):
        _require_file(path, str(path))
        data: dict[str, Any] = {"source": str(path.resolve())}
        return Scenario(config=_parse(data, overrides, str(path), Path()), folder=Path(), path=None)
    data = check_schema(read_toml(path), SCHEMA, str(path))
    config = _parse(data, overrides, str(path), path.parent)
    scenario = Scenario(config=config, folder=path.parent, path=path)
    _check_source(scenario, path)
    return scenario


def shipped_scenarios() -> list[str]:
    """Return the names of the scenarios that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml") if not is_road_file(path))


def _find(name_or_path: str) -> Path:
    if not name_or_path:
        raise ConfigError("scenario '': an empty name; leave it out for the shipped one")
    path = user_path(name_or_path)
    if path.suffix or path.exists():
        if not path.exists():
            raise ConfigError(f"{path}: no such file")
        return path
    shipped = SHIPPED / f"{name_or_path}.toml"
    if not shipped.exists():
        raise ConfigError(
            f"{name_or_path}: neither a file nor a shipped scenario ({', '.join(shipped_scenarios())})"
        )
    return shipped


def read_camera_file(path: Path) -> CameraFileConfig:
    """Read a camera file, or the camera and vehicle of a scenario file; raises ConfigError."""
    data = read_toml(path)
    if str(data.get("schema")).partition("/")[0] != SCHEMA.partition("/")[0]:
        return convert(check_schema(data, CAMERA_SCHEMA, str(path)), CameraFileConfig, str(path))
    config = _parse(check_schema(data, SCHEMA, str(path)), None, str(path), path.parent)
    return CameraFileConfig(camera=config.camera, vehicle=config.vehicle)


def _parse(
    data: dict[str, Any], overrides: dict[str, Any] | None, where: str, folder: Path
) -> ScenarioConfig:
    """Convert with `overrides` put over the file's keys, and these over those of its camera file."""
    merged = _over(data, overrides or {})
    if isinstance(name := merged.get("camera_file"), str):
        path = folder / user_path(name)
        camera = check_schema(read_toml(path), CAMERA_SCHEMA, str(path))
        convert(camera, CameraFileConfig, str(path))
        merged = _over(camera, merged)
    return convert(merged, ScenarioConfig, where)


def _over(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Put keys over others, key by key where both hold a table."""
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = {**under, **value} if isinstance(value, dict) and isinstance(under, dict) else value
    return merged


def _check_source(scenario: Scenario, path: Path) -> None:
    source = scenario.source
    if not _is_source(source) and (source.suffix.lower() != ".toml" or source.is_file()):
        known = " ".join(SOURCE_SUFFIXES)
        raise ConfigError(
            f"{path}: source = {scenario.config.source!r}: "
            f"expected a map, storyboard or log ({known}) or a road (.toml)"
        )
    _require_file(source, f"{path}: source = {scenario.config.source!r}")


def _is_source(path: Path) -> bool:
    """Return whether a drive can come from a file: a map, a road file, a storyboard, a log."""
    return path.suffix.lower() in SOURCE_SUFFIXES or is_road_file(path)


def _require_file(path: Path, where: str) -> None:
    if path.is_dir():
        raise ConfigError(f"{where}: is a folder, a map, storyboard or log was expected")
    if not path.is_file():
        raise ConfigError(f"{where}: no such file" + (f": {path}" if where != str(path) else ""))
