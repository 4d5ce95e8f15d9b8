"""dbc/README.md tells every key that a profile may have."""

from pathlib import Path

import msgspec
import pytest

from vsensor.profile import ProfileConfig
from vsensor.profile.burst_config import BurstChecksumConfig, BurstConfig, CoverConfig
from vsensor.profile.config import E2eConfig, GeometryConfig, MessageConfig, SignalConfig
from vsensor.profile.sending import GroupConfig, SendConfig

TEXT = (Path(__file__).parents[2] / "dbc" / "README.md").read_text(encoding="utf-8")
CONFIGS = [
    *(ProfileConfig, GeometryConfig, MessageConfig, SignalConfig, E2eConfig),
    *(BurstConfig, BurstChecksumConfig, CoverConfig, SendConfig, GroupConfig),
]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda config: config.__name__)
def test_the_readme_tells_every_key(config):
    for field in msgspec.structs.fields(config):
        name = field.name
        marks = (f"`{name}`", f"{name} = ", f"[{name}.", f"[{name}]", f".{name}]")
        assert any(mark in TEXT for mark in marks), name
