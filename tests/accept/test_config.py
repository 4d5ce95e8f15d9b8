"""Limits: their file, their defaults in README, and that each is kept."""

import re
import tomllib
from pathlib import Path

import msgspec
import pytest

from tests.accept.streams import found, spoiled, verdict
from tests.ecu.streams import crc_wrong, delayed, lane, lost, stream
from vsensor.accept import CONSUMER, Kind, LimitsConfig, load_limits
from vsensor.e2e import ReceiverConfig
from vsensor.errors import ConfigError

README = Path(__file__).parents[2] / "README.md"
HEAD = 'schema = "vsensor.accept/1"\n'


def limits_file(folder, text):
    path = folder / "limits.toml"
    path.write_text(text)
    return path


def test_without_a_file_the_limits_are_the_defaults():
    assert load_limits(None) == LimitsConfig()


def test_a_file_says_only_what_differs(tmp_path):
    text = HEAD + "jitter_ms = 20\n[receiver]\nmax_error_valid = 1\n[allow]\nlate = 3\n"
    expected = LimitsConfig(jitter_ms=20.0, receiver=ReceiverConfig(max_error_valid=1), allow={"late": 3})
    assert load_limits(limits_file(tmp_path, text)) == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("jitter_ms = 20\n", "schema"),
        (HEAD + "jiter_ms = 20\n", "jiter_ms: unknown key; did you mean jitter_ms"),
        (HEAD + "cycle_tolerance = 0.9\n", "cycle_tolerance"),
        (HEAD + 'timestamps = "maybe"\n', "timestamps"),
        (HEAD + "[allow]\nlatee = 3\n", "allow.latee: unknown key; did you mean late?"),
        (HEAD + "[allow]\nxyz = 3\n", "allow.xyz: unknown key; known keys: burst_checksum, "),
        (HEAD + "[receiver]\nmin_ok_valid = 0\n", "receiver.min_ok_valid"),
        (HEAD + "[receiver]\nwindow_size_valid = 3\n", "window_size_valid"),
        (HEAD + "jitter_ms = nan\n", "finite"),
        (HEAD + "lane_width_m = [5.5, 2.0]\n", "lane_width_m"),
    ],
)
def test_a_wrong_limit_is_one_line_that_names_it(tmp_path, text, said):
    with pytest.raises(ConfigError, match=said) as caught:
        load_limits(limits_file(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert "limits.toml" in str(caught.value)


def test_readme_has_every_limit_with_its_default():
    rows = re.findall(r"^\| `(\w+)` \| (\S+|`\[.*?\]`) \|", _table(), re.MULTILINE)
    said = {name: tomllib.loads(f"x = {cell.strip('`')}")["x"] for name, cell in rows if "`" in cell}
    defaults = msgspec.to_builtins(LimitsConfig())
    plain = {name: value for name, value in defaults.items() if not isinstance(value, dict)}
    assert said == {k: list(v) if isinstance(v, list | tuple) else v for k, v in plain.items()}
    assert set(re.findall(r"^\| `(\w+)`", _table(), re.MULTILINE)) == set(defaults)


def _table():
    text = README.read_text(encoding="utf-8")
    return text[text.index("| limit | default | what |") :].split("\n\n", 1)[0]


def test_every_kind_has_a_word_on_what_a_consumer_does():
    assert set(CONSUMER) == set(Kind.__args__)
    assert all(CONSUMER.values())


# --- each limit is kept -------------------------------------------------------------------------------


def test_what_is_allowed_is_a_remark():
    frames = spoiled(crc_wrong, images=(10, 30))
    assert found(frames, allow={"wrong_crc": 1}) == {("wrong_crc", "LDS_LeftLine"): 2}
    judgement = verdict(frames, allow={"wrong_crc": 2})
    assert judgement.is_accepted
    assert "allowed: 2 wrong_crc in LDS_LeftLine" in judgement.remarks


def test_the_jitter_that_passes_is_the_limits():
    frames = spoiled(delayed(20), message="LDS_NextMarkings", images=(20,))
    assert found(frames) == {("late", "LDS_NextMarkings"): 1}
    assert found(frames, jitter_ms=20.0) == {}


def test_the_receivers_tolerances_are_the_limits():
    frames = spoiled(crc_wrong, images=(10,))
    strict = ReceiverConfig(max_error_valid=0, max_error_init=0, max_error_invalid=0)
    assert ("e2e_invalid", "LDS_LeftLine") not in found(frames)
    assert found(frames, receiver=strict)[("e2e_invalid", "LDS_LeftLine")] == 1


def test_the_steps_that_pass_are_the_limits():
    frames = stream(60, lambda k: {**lane(k), **({"left.offset_m": 2.0} if k == 30 else {})})
    assert found(frames) == {}
    assert found(frames, offset_step_m=0.2) == {("jump", "LDS_LeftLine"): 2}


def test_lines_that_begin_far_ahead_are_not_compared():
    frames = stream(
        60, lambda k: {**lane(k), "left.x_min_m": 20.0, **({"left.offset_m": 3.0} if k == 30 else {})}
    )
    assert found(frames) == {}
    assert found(frames, near_m=25.0) == {("jump", "LDS_LeftLine"): 2}


def test_half_of_a_second_of_silence_passes_where_the_cycle_may_be_off_that_far():
    assert ("missing", "LDS_LeftLine") in found(spoiled(lost, images=range(20, 30)))
    assert not any(
        kind == "missing" for kind, _ in found(spoiled(lost, images=range(20, 30)), jitter_ms=500.0)
    )
