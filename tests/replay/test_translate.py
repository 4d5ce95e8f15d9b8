"""One car's lanes sent as another's: what arrives, when, what is lost, and what is told of it."""

import numpy as np
import pytest
from msgspec.structs import replace

from tests.accept.streams import found
from tests.bus_values import boundary, ego, estimate
from tests.ecu.streams import IDS, VEHICLE, lane, stream, write
from tests.replay.playing import play, player_of
from tests.replay.repairing import NATIVE, faster, looped, through, values_of
from tests.shared import SHARED_DATA, needs_shared
from vsensor.cli import main
from vsensor.errors import ConfigError
from vsensor.logs import frames_of, read_log
from vsensor.profile import load_profile, quantisation_error_m
from vsensor.replay.beat import beat_of
from vsensor.replay.choice import keys_of
from vsensor.replay.reading import Cut, survey
from vsensor.replay.translate import Translate
from vsensor.signals import from_bus, values_from
from vsensor.types import SIDE_NAMES, Frame, SensorMode, Side

MS = 1_000_000
DBC = SHARED_DATA / "dbc"
FILES = {
    "honda": DBC / "honda_bosch_lane_lines_extract.dbc",
    "hyundai": DBC / "hyundai_canfd_fr_cmr_03_extract.dbc",
    "tesla": DBC / "tesla_das_lanes_extract.dbc",
}
OURS = ("native", "native_fd", "p2")
CAMERA_X_M = 1.9
IMAGES = 30
GOOD = stream(IMAGES)
AT_M = np.array([20.0, 50.0, 80.0, 100.0])


def profile(name):
    return load_profile(name, FILES.get(name))


def translation(source, target, **wishes):
    return Translate(profile(source), profile(target), camera_x_m=CAMERA_X_M, **wishes).stage()


def translated(frames, source, target, **wishes):
    return through(translation(source, target, **wishes), frames)[0]


def told(frames, source, target):
    stage = translation(source, target)
    return "\n".join(stage.told(through(stage, frames)[1]))


def times_ms(frames):
    return np.array([frame.due_ns for frame in frames]) / MS


def without_cubic(index):
    """The values of an image whose lines are parabolas: Honda's bus has no cubic coefficient."""
    places = {Side.LEFT: 1.75, Side.RIGHT: -1.75, Side.NEXT_LEFT: 5.25, Side.NEXT_RIGHT: -5.25}
    moved = np.random.default_rng(index).normal(scale=(0.02, 0.002, 2e-5))
    lines = [boundary(side, [y + moved[0], moved[1], 1e-4 + moved[2]]) for side, y in places.items()]
    return dict(values_from(VEHICLE, estimate(*lines, index=index), ego(), SensorMode.AVAILABLE))


def polynomials(profile, frames):
    """Lines (images, 4, 3) of a stream, c0, c1, c2 in the model's frame."""
    found, told = [], {}
    for frame in frames:
        values = profile.decode(frame) or {}
        if told.keys() & values.keys() >= {"left.offset_m"}:
            found.append(told)
            told = {}
        told = {**told, **values}
    lines = [from_bus(profile.geometry, VEHICLE, values, CAMERA_X_M) for values in [*found, told]]
    return np.array(
        [
            [
                (v[f"{w}.offset_m"], v[f"{w}.heading"], v[f"{w}.curvature_per_m"] / 2)
                for w in SIDE_NAMES.values()
            ]
            for v in lines
        ]
    )


@needs_shared
@pytest.mark.parametrize("target", [*FILES, *OURS])
def test_what_is_sent_is_accepted_by_the_targets_ecu(target):
    assert found(translated(GOOD, "native", target), profile(target)) == {}


@needs_shared
@pytest.mark.parametrize("source", FILES)
def test_a_makers_log_is_accepted_as_ours(source):
    if source == "tesla":  # has one virtual line in the middle, and no line of its own
        with_lines = translated(translated(GOOD, "native", source), source, "native")
        assert set(values_of(NATIVE, with_lines, "left.available")) == {0.0}
    else:
        assert found(translated(translated(GOOD, "native", source), source, "native")) == {}


@needs_shared
@pytest.mark.parametrize("maker", ["honda", "hyundai"])
def test_there_and_back_a_line_is_off_by_what_both_quantisations_add_and_no_more(maker):
    frames = stream(IMAGES, without_cubic)
    back = translated(translated(frames, "native", maker), maker, "native")
    before, after = polynomials(NATIVE, frames), polynomials(NATIVE, back)[:, : 4 if maker == "honda" else 2]
    before = before[:, : after.shape[1]]
    powers = AT_M[:, None] ** np.arange(3)
    y_before, y_after = (np.einsum("ilk,rk->ilr", c, powers) for c in (before, after))
    off = np.abs(y_after[:, None] - y_before[None]).max(axis=2)  # (after, before, ranges): images repeat
    ours, theirs = (np.array([*quantisation_error_m(p).values()]) for p in (NATIVE, profile(maker)))
    worst = (off / (ours + theirs)).max(axis=2)  # of each image sent, beside each of the log
    assert worst.min(axis=1).max() <= 1.0
    assert worst.min(axis=1).max() > 0.2
    assert len(set(worst.argmin(axis=1))) > IMAGES / 2


def test_the_same_profile_gives_the_same_frames_images_and_counters():
    sent = translated(GOOD, "native", "native")
    first = 13  # the first image tells what an image has
    assert [frame.data[2:] for frame in sent[: len(GOOD) - 13]] == [f.data[2:] for f in GOOD[first:]]


@needs_shared
@pytest.mark.parametrize(("target", "cycle_ms"), [("hyundai", 50.0), ("tesla", 100.0), ("honda", 40.0)])
@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0])
def test_the_target_keeps_its_own_cycle_at_any_speed(target, cycle_ms, speed):
    sent = translated(faster(looped(GOOD, 3, IMAGES), speed), "native", target, speed=speed)
    mine = [f for f in sent if f.arbitration_id == sent[0].arbitration_id]
    assert np.diff(times_ms(mine)) == pytest.approx(cycle_ms, abs=1.01 if speed == 1.0 else 1e-6)


def test_images_that_come_early_or_late_are_sent_once_each_and_evenly():
    jitter = np.random.default_rng(5).uniform(-6, 6, size=200)
    frames = [replace(f, due_ns=f.due_ns + round(jitter[k // 13] * MS)) for k, f in enumerate(stream(200))]
    sent = translated(frames, "native", "native")
    indices = values_of(NATIVE, sent, "image.index")
    assert set(np.diff(indices[:-2])) == {1.0}
    mine = [f for f in sent if f.arbitration_id == IDS["LDS_Image"]]
    assert np.abs(np.diff(times_ms(mine)) - 40).max() <= 1.01
    assert found(sent) == {}


def test_a_clock_of_the_sensor_that_is_off_by_a_thousandth_is_followed():
    sent = translated(faster(stream(400), 0.999), "native", "native")
    assert set(np.diff(values_of(NATIVE, sent, "image.index")[:-2])) == {1.0}


def test_other_frames_pass_and_those_with_an_id_of_the_target_do_not():
    other = replace(GOOD[30], arbitration_id=0x123, channel=0)
    clashing = replace(GOOD[40], arbitration_id=profile("p2").messages[0].layout.arbitration_id)
    sent = translated([*GOOD[:30], other, clashing, *GOOD[30:]], "native", "p2")
    ids = {plan.layout.arbitration_id for plan in profile("p2").messages}
    assert {f.arbitration_id for f in sent} == {0x123, *ids}
    assert clashing not in sent
    assert "1 frames of the log with an id that p2 sends" in told([*GOOD, clashing], "native", "p2")


def test_an_image_that_lacks_a_frame_is_left_out_and_counted():
    torn = [f for k, f in enumerate(GOOD) if k != 13 * 10 + 4]
    sent = translated(torn, "native", "native")
    assert 10.0 not in values_of(NATIVE, sent, "image.index")
    assert "1 images that lacked a frame" in told(torn, "native", "native")


def test_frames_with_a_wrong_checksum_are_not_believed():
    wrong = [replace(f, data=f.data[:-1] + b"\x5a") if k == 13 * 10 + 4 else f for k, f in enumerate(GOOD)]
    assert "1 frames with a wrong checksum" in told(wrong, "native", "native")
    assert 10.0 not in values_of(NATIVE, translated(wrong, "native", "native"), "image.index")


def test_while_the_source_is_silent_the_target_is_silent_and_then_goes_on_in_its_grid():
    silent = [f for k, f in enumerate(stream(60)) if not 20 <= k // 13 < 45]
    sent = [f for f in translated(silent, "native", "native") if f.arbitration_id == IDS["LDS_Image"]]
    steps = np.diff(times_ms(sent))
    assert np.count_nonzero(steps > 500) == 1
    assert steps[steps < 500] == pytest.approx(40, abs=1.01)
    assert steps.max() % 40 == pytest.approx(0, abs=1.01)


def test_a_line_that_is_gone_is_gone_in_the_target():
    def values(index):
        return lane(index, sides=(Side.LEFT,) if index > 15 else (Side.LEFT, Side.RIGHT))

    sent = translated(stream(IMAGES, values), "native", "native")
    assert values_of(NATIVE, sent, "right.available")[0] == 1.0
    assert values_of(NATIVE, sent, "right.available")[-1] == 0.0
    assert np.isnan(values_of(NATIVE, sent, "right.offset_m")[-1])
    assert found(sent) == {}


@needs_shared
def test_the_loss_is_the_rounding_of_the_target_and_what_it_lacks_is_named():
    stage = translation("native", "honda")
    _, state = through(stage, GOOD)
    honda = profile("honda")
    binding = next(b for plan in honda.messages for b in plan.bindings if b.quantity == "left.offset_m")
    half_m = abs(binding.signal.scale / binding.gain) / 2
    loss = state.losses["left.offset_m"]
    assert (loss.images, loss.lost) == (IMAGES - 1, 0)
    assert half_m / 20 < loss.rms <= loss.largest <= half_m + 3e-4  # the angle's rounding times 1.9 m
    lines = "\n".join(stage.told(state))
    assert "honda has no: lane.change" in lines
    assert "lines.curvature_rate_per_m2" in lines
    assert "native has no" not in lines


@needs_shared
def test_what_the_source_has_not_is_told_and_derived_where_that_is_possible():
    honda = translated(GOOD, "native", "honda")
    lines = told(honda, "honda", "native")
    assert "honda has no, so not available or a default: lane.lateral_speed_mps" in lines
    assert "so derived or assumed: lane.change, lane.width_m" in lines
    sent = translated(honda, "honda", "native")
    wanted = np.mean(values_of(NATIVE, GOOD, "lane.width_m"))
    assert np.mean(values_of(NATIVE, sent, "lane.width_m")) == pytest.approx(wanted, abs=0.01)


@needs_shared
def test_a_loop_and_a_seek_of_a_translated_log_are_accepted(tmp_path):
    write(GOOD, tmp_path / "a.log")
    head = survey(tmp_path / "a.log")
    beat = beat_of([NATIVE], keys_of(head.columns), head.m_ns, {})
    one, bus = player_of(
        tmp_path / "a.log", stages=[translation("native", "honda")], cut=Cut(beat=beat, loops=3)
    )
    play(one, until_ms=500)
    one.seek(0.9)
    play(one)
    sent = [replace(f, due_ns=round(ms * MS)) for f, (ms, _) in zip(bus.frames, bus.sent, strict=True)]
    assert found(sent, profile("honda")) == {}
    assert set(np.diff(values_of(profile("honda"), sent, "image.index")) % 4) <= {0.0, 1.0}


@needs_shared
def test_the_command_names_each_profile_with_its_own_database(tmp_path, capsys):
    frames = translated(GOOD, "native", "honda")
    write(frames, tmp_path / "honda.log")
    words = ["--as-fast-as-possible", "--from", f"honda={FILES['honda']}", "--log", str(tmp_path / "b.blf")]
    words += ["--as", f"hyundai={FILES['hyundai']}"]
    assert main(["replay", str(tmp_path / "honda.log"), *words]) == 0
    assert "translated honda to hyundai: " in capsys.readouterr().out
    sent = list(frames_of(read_log(tmp_path / "b.blf").columns))
    assert {frame.is_fd for frame in sent} == {True}
    assert found(sent, profile("hyundai")) == {}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--as", "native"], "--from and --as belong together"),
        (["--from", "native"], "--from and --as belong together"),
        (["--from", "vehicle", "--as", "native"], "carries no lane"),
        (["--from", "native", "--as", "vehicle"], 'role = "vehicle"'),
        (["--from", "native", "--as", "honda"], "not shipped; give it with --dbc"),
        (["--camera-x", "1"], "--as, which is not given"),
    ],
)
def test_a_translation_that_cannot_be_meant_is_refused(tmp_path, words, said, capsys):
    write(GOOD[:13], tmp_path / "a.log")
    assert main(["replay", str(tmp_path / "a.log"), "--as-fast-as-possible", *words]) == 2
    assert said in capsys.readouterr().err


@needs_shared
def test_a_profile_that_counts_from_the_camera_needs_to_know_where_it_is():
    with pytest.raises(ConfigError, match="no camera here"):
        Translate(NATIVE, profile("honda"))


def test_an_error_or_remote_frame_of_the_source_is_no_image():
    remote = Frame(due_ns=GOOD[20].due_ns, arbitration_id=IDS["LDS_Lane"], data=bytes(8), is_remote=True)
    sent = translated([*GOOD[:20], remote, *GOOD[20:]], "native", "native")
    assert remote not in sent
    assert found(sent) == {}
