"""A measured vibration from a file: played without a jump, refused where it cannot be meant."""

import numpy as np
import pytest

from vsensor.errors import ConfigError
from vsensor.motion import MotionConfig, load_motion, load_recording

NAMES = ("t_s", "pitch_mrad", "roll_mrad", "heave_mm")


@pytest.fixture
def written(tmp_path):
    """Return a function that writes rows of the four columns as a file of the wanted kind."""

    def write(columns, suffix=".csv"):
        path = tmp_path / f"shake{suffix}"
        if suffix == ".npz":
            np.savez(path, **columns)
        else:
            rows = zip(*columns.values(), strict=True)
            path.write_text("\n".join(",".join(map(str, row)) for row in [tuple(columns), *rows]) + "\n")
        return path

    return write


def noise(count=200):
    """Return a made series whose times begin anywhere and are uneven."""
    rng = np.random.default_rng(1)
    values = [rng.normal(0.0, size, count) for size in (2.0, 1.0, 5.0)]
    return dict(zip(NAMES, [7.0 + np.cumsum(rng.uniform(0.005, 0.02, count)), *values], strict=True))


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_the_samples_are_there_at_their_times(written, suffix):
    columns = noise()
    recording = load_recording(written(columns, suffix))
    times_ns = np.round((columns["t_s"] - columns["t_s"][0]) * 1e9).astype(int)
    found = np.array([recording.motion(t) for t in times_ns.tolist()])
    expected = np.column_stack([columns[name] for name in NAMES[1:]]) / 1e3
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)  # half a ns of a steep slope


def test_between_the_samples_it_is_linear(written):
    recording = load_recording(written({"t_s": [0, 1], "pitch_mrad": [1, 3], "heave_mm": [0, -8]}))
    assert recording.motion(250_000_000) == pytest.approx((1.5e-3, 0.0, -2e-3))


def test_it_repeats_without_a_jump_for_ever(written):
    recording = load_recording(written(noise()))
    step_ns = 1_000_000
    values = np.array([recording.motion(k * step_ns) for k in range(10_000)])
    slopes = np.diff([recording.pitch_rad, recording.roll_rad, recording.heave_m]) / np.diff(recording.t_s)
    steepest = np.abs(slopes).max(axis=1) * step_ns / 1e9
    assert (np.abs(np.diff(values, axis=0)) <= steepest * (1 + 1e-9)).all()


def test_what_is_played_has_the_values_of_the_file_no_more_no_less(written):
    columns = noise(2000)
    recording = load_recording(written(columns))
    length_ns = round(recording.t_s[-1] * 1e9)
    played = np.array([recording.motion(t)[0] for t in range(0, 6 * length_ns, 7_000_003)])
    fine = np.interp(np.linspace(0, recording.t_s[-1], 20_000), recording.t_s, recording.pitch_rad)
    assert played.min() >= min(recording.pitch_rad)
    assert played.max() <= max(recording.pitch_rad)
    np.testing.assert_allclose(
        np.quantile(played, [0.1, 0.5, 0.9]), np.quantile(fine, [0.1, 0.5, 0.9]), atol=1e-4
    )


def test_times_after_days_are_still_in_place(written):
    recording = load_recording(written({"t_s": [0, 0.5, 2], "pitch_mrad": [1, 3, -4]}))
    month_ns = 30 * 86_400 * 10**9  # whole turns of 4 s
    assert recording.motion(month_ns + 123_000_000) == pytest.approx(recording.motion(123_000_000), abs=1e-11)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"t_s": [0, 1], "pitch": [1, 2]}, "columns t_s, pitch: t_s and some of pitch_mrad"),
        ({"pitch_mrad": [1, 2]}, "t_s and some of"),
        ({"t_s": [0, 1]}, "t_s and some of"),
        ({"t_s": [0, 0], "pitch_mrad": [1, 2]}, "t_s: at least 2 rising values"),
        ({"t_s": [0], "pitch_mrad": [1]}, "t_s: at least 2 rising values"),
        ({"t_s": [0, 1], "pitch_mrad": [1, 700]}, "pitch_mrad: 2 values of at most 500"),
        ({"t_s": [0, 1], "roll_mrad": [1, "nan"]}, "roll_mrad: a row of finite numbers"),
        ({"t_s": [0, 1], "heave_mm": ["a", 2]}, "heave_mm: numbers were expected"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused_by_name(written, columns, said):
    path = written(columns)
    with pytest.raises(ConfigError) as refused:
        load_recording(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("absent.csv", None, "no such file"),
        ("absent.npz", None, "no such file"),
        ("empty.csv", b"", "an empty file"),
        ("ragged.csv", b"t_s,pitch_mrad\n0,1\n1\n", "row 3 has 1 values, the header 2"),
        ("binary.csv", b"\xff\xfe\x00", "not a readable CSV"),
        ("text.npz", b"t_s,pitch_mrad\n", "not a readable .npz"),
        ("empty.npz", b"", "not a readable .npz"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_by_name(tmp_path, name, content, said):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match=said):
        load_recording(path)


def test_a_relative_path_starts_from_the_scenarios_folder(written):
    path = written(noise())
    motion = load_motion(MotionConfig(vibration_file=path.name), folder=path.parent)
    assert motion.recording == load_recording(path)


def test_a_file_and_a_preset_at_once_are_refused(written):
    with pytest.raises(ConfigError, match="either a file or"):
        load_motion(MotionConfig(vibration="smooth", vibration_file=str(written(noise()))))
