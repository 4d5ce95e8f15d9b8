"""Every shipped profile on a real vcan: what candump hears is what was sent, and a consumer accepts it."""

import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.vcan.listening import recorded
from tests.vcan.programs import ran
from tests.vcan.test_accept import LOADED
from vsensor.accept import accept_log, load_limits
from vsensor.profile import load_profiles

pytestmark = pytest.mark.vcan

MAKERS = {
    "honda": "honda_bosch_lane_lines_extract",
    "hyundai": "hyundai_canfd_fr_cmr_03_extract",
    "tesla": "tesla_das_lanes_extract",
}
FRAMES_PER_S = {"native": 325, "native_fd": 75, "p2": 20, "honda": 200, "hyundai": 20, "tesla": 25}
SECONDS = 2


def frames(log):
    """Return (identifier, bit rate switch or None, data) of every frame; the other flags are the kernel's."""
    found = []
    for line in log.read_text().splitlines():
        name, _, data = line.split()[2].partition("#")
        switched = bool(int(data[1], 16) & 1) if data.startswith("#") else None
        found.append((name, switched, data if switched is None else data[2:]))
    return found


@needs_shared
@pytest.mark.parametrize("name", FRAMES_PER_S)
def test_a_shipped_profile_is_heard_bit_for_bit_and_accepted(tmp_path, name):
    dbc = SHARED_DATA / "dbc" / f"{MAKERS[name]}.dbc" if name in MAKERS else None
    profile = ["--profile", name, *(["--dbc", dbc] if dbc else [])]
    seen, sent = tmp_path / "seen.log", tmp_path / "sent.log"
    with recorded("vcan0", seen):
        run = ran(
            "vsensor.cli", "run", "--bus", "socketcan:vcan0", "--duration", SECONDS, "--log", sent, *profile
        )
    assert run.returncode == 0, run.stderr
    heard = frames(seen)
    assert heard == frames(sent)
    assert FRAMES_PER_S[name] * SECONDS / 4 < len(heard) <= FRAMES_PER_S[name] * SECONDS
    limits = tmp_path / "limits.toml"
    limits.write_text(LOADED)
    judged = accept_log(seen, load_profiles([name], dbc), load_limits(limits))
    assert judged.is_accepted, judged.lines()
