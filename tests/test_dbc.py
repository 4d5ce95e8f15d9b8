"""The shipped databases: complete, consistent, and fine enough."""

import tomllib
from pathlib import Path

import cantools
import pytest

from vsensor.codec import load_database
from vsensor.profile import (
    QUANTITIES,
    SCHEMA,
    ProfileConfig,
    load_profile,
    quantisation_error_m,
    shipped_profiles,
)
from vsensor.schema import check_schema, convert
from vsensor.types import Colour, Light, MarkingKind, SensorMode

DBC = Path(__file__).parents[1] / "dbc"
PROFILES = {"lds": "native", "lds_fd": "native_fd", "p2": "p2", "vehicle": "vehicle"}
NAMES = list(PROFILES)
CYCLES_MS = {"lds": 40, "lds_fd": 40, "p2": 100}
E2E = {"lds": "P01", "lds_fd": "P05", "p2": "P01", "vehicle": "P01"}
SIGNALS = [
    (name, m, s)
    for name in NAMES
    for m in cantools.database.load_file(DBC / f"{name}.dbc").messages
    for s in m.signals
]
IDS = [f"{name}.{message.name}.{signal.name}" for name, message, signal in SIGNALS]


@pytest.mark.parametrize(("_", "message", "signal"), SIGNALS, ids=IDS)
def test_every_signal_has_a_comment_a_start_value_and_the_range_of_its_bits(_, message, signal):
    low = -(1 << signal.length - 1) if signal.is_signed else 0
    high = (1 << signal.length - signal.is_signed) - 1
    assert signal.comment
    assert low <= signal.raw_initial <= high
    assert signal.minimum == pytest.approx(low * signal.scale + signal.offset)
    assert signal.maximum == pytest.approx(high * signal.scale + signal.offset)
    if "GenSigSNA" in signal.dbc.attributes:
        sna = int(signal.dbc.attributes["GenSigSNA"].value)
        assert low <= sna <= high
        assert signal.raw_initial == sna
        assert str(signal.choices[sna]) == "SNA"


@pytest.mark.parametrize("name", NAMES)
def test_every_message_has_a_cycle_time_a_sender_a_comment_and_its_own_data_id(name):
    layouts = load_database(DBC / f"{name}.dbc").layouts.values()
    assert all(layout.cycle_ms and layout.send_type == "Cyclic" for layout in layouts)
    assert all(layout.comment and layout.senders for layout in layouts)
    assert {layout.e2e_profile for layout in layouts} == {E2E[name]}
    assert len({layout.e2e_data_id for layout in layouts}) == len(layouts)


@pytest.mark.parametrize("name", CYCLES_MS)
def test_the_sensor_sends_at_one_cycle(name):
    cycles = {layout.cycle_ms for layout in load_database(DBC / f"{name}.dbc").layouts.values()}
    assert cycles == {CYCLES_MS[name]}


def test_no_two_shipped_messages_share_an_id_or_a_data_id():
    layouts = [layout for name in NAMES for layout in load_database(DBC / f"{name}.dbc").layouts.values()]
    assert len({layout.arbitration_id for layout in layouts}) == len(layouts)
    assert len({layout.e2e_data_id for layout in layouts}) == len(layouts)


def test_can_fd_carries_the_same_quantities_in_the_same_steps_as_classic_can():
    classic, fd = (
        {b.quantity: b for p in load_profile(n).messages for b in p.told} for n in ("native", "native_fd")
    )
    assert set(classic) == set(fd)
    for quantity, binding in classic.items():
        ours, theirs = binding.signal, fd[quantity].signal
        same = ("length", "scale", "offset", "signed", "unit", "sna_raw", "start_raw", "choices", "comment")
        assert {key: getattr(ours, key) for key in same} == {key: getattr(theirs, key) for key in same}


def test_can_fd_frames_have_lengths_that_can_fd_has_and_switch_the_bit_rate():
    plans = load_profile("native_fd").messages
    assert [plan.layout.length for plan in plans] == [32, 48, 48]
    assert all(plan.layout.is_fd and plan.bitrate_switch and not plan.padding for plan in plans)
    assert not any(plan.layout.is_fd for name in ("native", "p2") for plan in load_profile(name).messages)


@pytest.mark.parametrize(
    ("signal", "codes"),
    [("LeftKind", MarkingKind), ("LeftColour", Colour), ("SensorState", SensorMode), ("AmbientLight", Light)],
)
def test_value_tables_name_the_models_codes(signal, codes):
    table = next(s for _, _, s in SIGNALS if s.name == signal).choices
    assert {raw: str(name).lower() for raw, name in table.items() if str(name) != "SNA"} == {
        int(code): code.name.lower().replace("_", "") for code in codes
    }


@pytest.mark.parametrize("name", ["native", "native_fd"])
def test_rounding_on_the_bus_adds_at_most_a_centimetre_at_100_m(name):
    errors = quantisation_error_m(load_profile(name))
    assert list(errors) == [20.0, 50.0, 80.0, 100.0]
    assert errors[100.0] == pytest.approx(0.0005 + 0.001 + 0.001 + 1e-8 / 2 * 1e6 / 6)
    assert errors[100.0] <= 0.01


def test_the_ranges_hold_roundabouts_and_town_junctions():
    signals = {s.name: s for _, _, s in SIGNALS}
    assert signals["LeftOffset"].maximum >= 32
    assert signals["LeftHeading"].maximum >= 1
    assert signals["LeftCurvature"].maximum >= 0.13
    assert signals["LeftCurvatureRate"].maximum >= 0.1


@pytest.mark.parametrize("name", NAMES)
def test_every_signal_is_used_by_its_profile(name):
    profile = load_profile(PROFILES[name])
    assert [plan.constants for plan in profile.messages] == [{}] * len(profile.messages)
    assert {p.layout.name for p in profile.messages} == set(load_database(DBC / f"{name}.dbc").layouts)


def test_the_readme_lists_every_message_and_every_signal():
    text = (DBC / "README.md").read_text(encoding="utf-8")
    for _, message, signal in SIGNALS:
        assert f"0x{message.frame_id:03X}" in text
        assert f"`{message.name}`" in text
        assert f"`{signal.name}`" in text


def test_the_shipped_profiles_are_found_by_name():
    makers = ["honda", "hyundai", "tesla", "toyota_rav4"]
    assert shipped_profiles() == sorted(["native", "native_fd", "p2", "vehicle", *makers])


def test_the_readme_names_every_shipped_file():
    text = (DBC / "README.md").read_text(encoding="utf-8")
    for file in (*DBC.glob("*.toml"), *DBC.glob("*.dbc")):
        assert f"`{file.name}`" in text


def test_the_readme_lists_every_quantity():
    text = (DBC / "README.md").read_text(encoding="utf-8")
    for name in QUANTITIES:
        assert f"`{name}`" in text or f"`LINE.{name.partition('.')[2]}`" in text


def test_the_readmes_example_profile_has_only_known_keys():
    text = (DBC / "README.md").read_text(encoding="utf-8")
    example = tomllib.loads(text.split("```toml")[1].split("```")[0])
    config = convert(check_schema(example, SCHEMA, "README.md"), ProfileConfig, "README.md")
    assert {s.quantity for s in config.messages["LANE_LEFT"].signals.values() if not isinstance(s, str)} - {
        None
    } <= set(QUANTITIES)
