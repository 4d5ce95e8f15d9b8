"""`vsensor video run --bus` on a real vcan: a video becomes lane traffic, at its own pace."""

import numpy as np
import pytest

from tests.vcan.listening import recorded
from tests.vcan.programs import ran
from tests.video.drawn import VEHICLE, road_picture
from tests.video.test_run import EVEN, write_video
from vsensor.logs import read_log
from vsensor.logs.decode import decode_frames
from vsensor.profile import load_profile
from vsensor.video.camera_file import VideoCamera, write_camera
from vsensor.video.rows import read_rows

pytestmark = pytest.mark.vcan
FRAMES = 10


def test_candump_hears_the_offsets_of_the_video_in_the_profile_s_cycle(tmp_path):
    pictures = [road_picture(EVEN, index=k, left_m=1.5 + 0.02 * k) for k in range(FRAMES)]
    write_video(tmp_path / "drive.avi", pictures)
    write_camera(tmp_path / "camera.toml", VideoCamera(EVEN, VEHICLE))
    words = ("--camera", tmp_path / "camera.toml", "--method", "published", "--out", tmp_path / "rows.csv")
    with recorded("vcan0", tmp_path / "seen.log"):
        run = ran(
            "vsensor.cli",
            "video",
            "run",
            tmp_path / "drive.avi",
            *words,
            "--bus",
            "socketcan:vcan0",
            "--profile",
            "p2",
            "--quiet",
        )
    assert run.returncode == 0, run.stderr
    frames = decode_frames(read_log(tmp_path / "seen.log"), [load_profile("p2")])  # CRCs are checked there
    rows = read_rows(tmp_path / "rows.csv")
    assert not [text for text in frames.findings if "CRC" in text]
    t_ns, heard_m = frames.series("left.lane_offset_m")
    assert len(heard_m) > FRAMES / 2  # a slot of a machine under load may be dropped
    assert (np.abs(heard_m[:, None] - rows.left_offset_m).min(axis=1) < 0.006).all()
    assert (t_ns[-1] - t_ns[0]) / 1e9 > 0.5 * 0.1 * len(heard_m)  # paced, not at once
