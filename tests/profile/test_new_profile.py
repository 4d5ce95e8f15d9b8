"""`vsensor profile new`: what is guessed is right where a database is clear, and marked where it is not."""

import re
import tomllib
from pathlib import Path

import cantools
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.made_profiles import HEAD, Sender, values
from tests.profile.test_formats import ARXML
from tests.shared import SHARED_DATA, needs_shared
from tests.test_cli import assert_one_line, vsensor
from vsensor.errors import ConfigError
from vsensor.profile import load_profile
from vsensor.profile_new import is_marked, new_profile, write_profile

OURS = Path(__file__).parents[2] / "dbc"
MAKERS = {
    "honda": "honda_bosch_lane_lines_extract",
    "hyundai": "hyundai_canfd_fr_cmr_03_extract",
    "tesla": "tesla_das_lanes_extract",
}
NO_WORD_FOR_IT = {("DAS_lanes", f"DAS_{side}LineUsage", f"{side}.quality") for side in ("left", "right")}


def skeleton(tmp_path, database, **options):
    """Write a skeleton; return it and the profile that it loads as."""
    out = tmp_path / "new.toml"
    found = new_profile(database, out, **options)
    write_profile(found, out, force=True)
    return found, load_profile(out)


def of_dbc(tmp_path, text, **options):
    database = tmp_path / "new.dbc"
    database.write_text(HEAD + text)
    return skeleton(tmp_path, database, **options)


def carried(profile):
    """Return what each signal carries, as (message, signal, quantity)."""
    return {(p.layout.name, b.signal.name, b.quantity) for p in profile.messages for b in p.bindings}


def line_of(found, name):
    """Return the line of the text that is about a signal."""
    (line,) = [line for line in found.text.splitlines() if line.removeprefix("# ").startswith(f"{name} ")]
    return line


# --- databases that are there ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["lds", "lds_fd"])
def test_the_skeleton_of_our_own_database_sends_what_the_shipped_profile_sends(tmp_path, name):
    found, guessed = skeleton(tmp_path, OURS / f"{name}.dbc")
    shipped = load_profile({"lds": "native", "lds_fd": "native_fd"}[name])
    assert carried(guessed) == carried(shipped)
    assert guessed.geometry == shipped.geometry
    one, other = Sender(shipped), Sender(guessed)
    for _ in range(20):
        assert one(values(speed_mps=20.0)) == other(values(speed_mps=20.0))
    assert found.open_marks == 1  # whether the frames of an image are a burst


@pytest.mark.parametrize(
    ("database", "shipped", "unknown"),
    [("p2", "p2", set()), ("vehicle", "vehicle", {"ego.steering_request_rad", "ego.lane_warning"})],
)
def test_the_other_databases_of_ours_are_guessed_whole(tmp_path, database, shipped, unknown):
    _, guessed = skeleton(tmp_path, OURS / f"{database}.dbc")
    theirs = load_profile(shipped)
    assert carried(guessed) == {one for one in carried(theirs) if one[2] not in unknown}
    assert guessed.role == theirs.role


@needs_shared
@pytest.mark.parametrize("maker", MAKERS)
def test_of_a_makers_database_every_line_signal_is_guessed_as_the_shipped_profile_has_it(tmp_path, maker):
    database = SHARED_DATA / "dbc" / f"{MAKERS[maker]}.dbc"
    found, guessed = skeleton(tmp_path, database)
    assert carried(guessed) == carried(load_profile(maker, database)) - NO_WORD_FOR_IT
    assert 'positive = "left"    #?' in found.text  # no database says it


@needs_shared
@pytest.mark.parametrize("name", [*MAKERS.values(), "canmod-gps", "toyota_rav4_2017_pt_generated"])
def test_check_lists_the_open_marks_of_any_makers_skeleton_and_nothing_that_hinders(capsys, tmp_path, name):
    out = tmp_path / "new.toml"
    status, _, err = vsensor(capsys, "profile", "new", SHARED_DATA / "dbc" / f"{name}.dbc", "--out", out)
    assert status == 0
    opened = sum(map(is_marked, out.read_text(encoding="utf-8").splitlines()))
    assert f"{opened} places open" in err
    assert opened > 0
    status, said, _ = vsensor(capsys, "check", out)
    assert status == 1
    assert said.count("open, see `#?`") == opened
    assert "cannot be sent" not in said


@needs_shared
@pytest.mark.parametrize(
    ("database", "expected"),
    [
        ("toyota_rav4_2017_pt_generated", {("ego.speed_mps", "SPEED"), ("ego.yaw_rate_radps", "YAW_RATE")}),
        (
            "ford_lincoln_base_pt",
            {("ego.speed_mps", "VehOverGnd_V_Est"), ("ego.yaw_rate_radps", "VehYawComp_W_Actl")},
        ),
        ("canmod-gps", {("ego.speed_mps", "Speed"), ("ego.yaw_rate_radps", "AngularRateZ")}),
    ],
)
def test_a_database_without_lanes_gives_what_the_sensor_listens_to(tmp_path, database, expected):
    found, profile = skeleton(tmp_path, SHARED_DATA / "dbc" / f"{database}.dbc")
    assert (found.role, profile.role) == ("vehicle", "vehicle")
    motion = {(quantity, name) for _, name, quantity in carried(profile)}
    assert {one for one in motion if one[0] in ("ego.speed_mps", "ego.yaw_rate_radps")} == expected


@pytest.mark.parametrize("suffix", [".kcd", ".sym", ".arxml"])
def test_every_format_is_guessed_from(tmp_path, suffix):
    path = tmp_path / f"lanes{suffix}"
    if suffix == ".arxml":
        path.write_text(
            ARXML.replace("SHORT-NAME>Off<", "SHORT-NAME>LeftLaneOffset<").replace(
                "/P/Off", "/P/LeftLaneOffset"
            )
        )
    else:
        dbc = HEAD + 'BO_ 291 Lane: 8 CAM\n SG_ LeftLaneOffset : 3|16@1- (0.002,0) [-65|65] "m" ECU\n'
        cantools.database.dump_file(cantools.database.load_string(dbc, "dbc"), str(path))
    _, profile = skeleton(tmp_path, path)
    assert [quantity for *_, quantity in carried(profile)] == ["left.offset_m"]


# --- what it reads out of names, units, comments, value tables --------------------------------------------


LINE = 'BO_ 1 LeftLine: 8 CAM\n SG_ Offset : 0|16@1- (0.001,0) [0|0] "m" ECU\n'


BIT = '16|1@1+ (1,0) [0|1] ""'
COUNT = '16|2@1+ (1,0) [0|3] ""'


@pytest.mark.parametrize(
    ("signal", "more", "said"),
    [
        (f"Valid : {BIT}", 'VAL_ 1 Valid 0 "Valid" 1 "Invalid";', 'valid_of = "left", valid_raw = 0'),
        (f"Valid : {BIT}", 'VAL_ 1 Valid 1 "Valid" 0 "Invalid";', 'valid_of = "left" }'),
        (f"OffsetInvalid : {BIT}", "", 'valid_of = "left.offset_m", valid_raw = 0'),
        (f"Ok : {BIT}", 'CM_ SG_ 1 Ok "0 = ok, 1 = not ok";', 'valid_of = "left", valid_raw = 0'),
        ('Angle : 16|12@1- (0.1,0) [0|0] "mrad"', "", '"left.heading"'),
        ('Range : 16|12@1+ (1,0) [0|0] "meters"', "", '"left.x_max_m"'),
        ('Curvature : 16|12@1- (1E-06,0) [0|0] "m-1"', "", '"left.curvature_per_m"'),
        ('C2 : 16|12@1- (1E-06,0) [0|0] "1/m"', "", '"left.c2_per_m"'),
        (f"Quality : {COUNT}", "", '"left.quality", table'),
        ('Quality : 16|8@1+ (1,0) [0|100] "%"', "", "factor = 0.25"),
        (f"Type : {COUNT}", 'VAL_ 1 Type 1 "SOLID" 2 "DASHED" 3 "Undecided";', 'dashed = "DASHED"'),
        ('Width : 16|9@1+ (1,0) [0|9] "cm"', 'VAL_ 1 Width 511 "SNA" 510 "Fault";', "sna = 511, error = 510"),
        (f"FrameIdx : {COUNT}", "", '"image.index", wrap = true'),
    ],
)
def test_a_signal_of_a_line_is_understood(tmp_path, signal, more, said):
    found, _ = of_dbc(tmp_path, f"{LINE} SG_ {signal} ECU\n{more}\n")
    assert said in line_of(found, signal.split()[0])


def test_a_distance_that_is_never_negative_is_taken_as_one_without_sign(tmp_path):
    found, profile = of_dbc(tmp_path, LINE.replace("16@1- (0.001,0)", "16@1+ (0.001,0)"))
    assert "magnitude = true }    #?" in line_of(found, "Offset")
    assert profile.messages[0].bindings[0].magnitude_sign == 1.0


def test_a_quantity_whose_unit_says_something_else_is_left_open(tmp_path):
    found, _ = of_dbc(tmp_path, f'{LINE} SG_ Heading : 16|12@1- (0.1,0) [0|0] "km/h" ECU\n')
    assert line_of(found, "Heading").startswith("# Heading =    #? left.heading?")


def test_the_second_signal_of_a_quantity_is_left_open_and_names_the_first(tmp_path):
    found, _ = of_dbc(tmp_path, f'{LINE} SG_ Position : 16|12@1- (0.1,0) [0|0] "m" ECU\n')
    assert "#? left.offset_m? LeftLine.Offset has it already" in line_of(found, "Position")


@pytest.mark.parametrize(
    ("comment", "answer"),
    [
        ("from the front axle", 'origin = "front_axle"\n'),
        ("from the bumper", 'origin = "bumper"\n'),
        ("positive to the right", 'positive = "right"\n'),
        ("to its inner edge", 'edge = "inner"\n'),
        ("", 'positive = "left"    #?'),
    ],
)
def test_the_geometry_is_answered_by_comments_and_else_open(tmp_path, comment, answer):
    found, _ = of_dbc(tmp_path, f'{LINE}CM_ SG_ 1 Offset "Offset {comment}";\n')
    if "inner" not in comment:
        assert answer in found.text
    else:
        assert 'Offset = "left.lane_offset_m"' in found.text


def test_a_cycle_that_the_database_has_not_is_asked_for(tmp_path):
    assert "cycle_ms = 40    #? not in the database" in of_dbc(tmp_path, LINE)[0].text


def test_the_node_chooses_and_is_named(tmp_path):
    other = 'BO_ 2 RightLine: 8 OTHER\n SG_ Offset : 0|16@1- (0.001,0) [0|0] "m" ECU\n'
    found, profile = of_dbc(tmp_path, LINE + other, node="CAM")
    assert carried(profile) == {("LeftLine", "Offset", "left.offset_m")}
    assert tomllib.loads(found.text)["node"] == "CAM"


def test_the_role_may_be_said(tmp_path):
    motion = 'BO_ 2 Motion: 8 CAM\n SG_ Speed : 0|16@1+ (0.01,0) [0|0] "km/h" ECU\n'
    assert carried(of_dbc(tmp_path, LINE + motion)[1]) >= {("LeftLine", "Offset", "left.offset_m")}
    assert carried(of_dbc(tmp_path, LINE + motion, role="vehicle")[1]) == {
        ("Motion", "Speed", "ego.speed_mps")
    }


# --- hostile ones -----------------------------------------------------------------------------------------


def test_text_of_the_database_makes_neither_marks_nor_lines(tmp_path):
    tricky = "what #? is\nthis = 1 \x7f \x01 ''' # \t"
    found, profile = of_dbc(
        tmp_path,
        LINE + ' SG_ LineType : 16|2@1+ (1,0) [0|3] "" ECU\n'
        f'CM_ SG_ 1 Offset "{tricky}";\nCM_ BO_ 1 "{tricky}";\n'
        'VAL_ 1 LineType 1 "solid #? \x7f" 2 "dashed #";\n',
    )
    assert carried(profile) == {
        ("LeftLine", "Offset", "left.offset_m"),
        ("LeftLine", "LineType", "left.kind"),
    }
    table = tomllib.loads(found.text)["messages"]["LeftLine"]["signals"]["LineType"]["table"]
    assert table["solid"] == "solid #? \x7f"
    assert not is_marked(line_of(found, "Offset"))


def test_names_that_are_no_bare_keys_are_quoted(tmp_path):
    path = tmp_path / "odd.kcd"
    dbc = HEAD + 'BO_ 1 Line: 8 CAM\n SG_ LeftLineOffset : 0|16@1- (0.001,0) [0|0] "m" ECU\n'
    cantools.database.dump_file(cantools.database.load_string(dbc, "dbc"), str(path))
    odd = path.read_text().replace('name="Line"', 'name="Line 1.a &quot;b&quot;"')
    path.write_text(odd.replace('name="LeftLineOffset"', 'name="Left Line.Offset \N{MICRO SIGN}"'))
    _, profile = skeleton(tmp_path, path)
    assert carried(profile) == {('Line 1.a "b"', "Left Line.Offset \N{MICRO SIGN}", "left.offset_m")}


def test_multiplexed_lines_are_mapped_page_by_page(tmp_path):
    _, profile = of_dbc(
        tmp_path,
        'BO_ 1 Lines: 8 CAM\n SG_ Which M : 0|2@1+ (1,0) [0|3] "" ECU\n'
        ' SG_ LeftOffset m0 : 8|16@1- (0.001,0) [0|0] "m" ECU\n'
        ' SG_ RightOffset m1 : 8|16@1- (0.001,0) [0|0] "m" ECU\n',
    )
    assert carried(profile) == {
        ("Lines", f"{side.title()}Offset", f"{side}.offset_m") for side in ("left", "right")
    }


def test_thousands_of_messages_do_not_hide_the_lanes(tmp_path):
    many = "".join(
        f'BO_ {10 + k} Other{k}: 8 ECU\n SG_ Pressure{k} : 0|16@1+ (1,0) [0|0] "bar" CAM\n'
        for k in range(1500)
    )
    _, profile = of_dbc(tmp_path, LINE + many)
    assert [plan.layout.name for plan in profile.messages] == ["LeftLine"]


WORDS = """
    Left Right Lft R Next Lane Line Ln Virtual Offset Pos C0 C1 C2 Curvature Rate Heading Angle Quality Conf
    Type Kind Width Colour Range Start End Valid Invalid Crc Checksum Counter Alive Frame Index Burst Speed
    Yaw Accel Lateral Time Crossing Status Camera Light Rain Change Order Measured Available Exists Indicator
    Wiper LowBeam Steering X Y Z Solid Dashed Offs Unavailable Timestamp Image
"""
NAMES = st.lists(st.sampled_from(re.findall(r"\w+", WORDS)), min_size=1, max_size=4).map("".join)
UNITS = re.findall(r"\S+", "m cm Meters km/h kph deg rad mrad deg/s 1/m m-2 s ms % \N{DEGREE SIGN} furlong")
TABLES = [
    "",
    '0 "None" 1 "Solid" 2 "Dashed"',
    '0 "Invalid" 1 "Valid"',
    '7 "SNA" 6 "Error"',
    '0 "Low" 1 "High" 3 "SNA"',
]


@st.composite
def databases(draw):
    """A DBC of lanes in the words of makers, with bits, signs, units and tables at random."""
    text, tables = "", ""
    for number in range(1, draw(st.integers(1, 3)) + 1):
        length = draw(st.sampled_from([8, 16, 64]))
        text += f"BO_ {number} {draw(NAMES)}{number}: {length} CAM\n"
        names, bit = draw(st.lists(NAMES, min_size=1, max_size=8, unique=True)), 0
        muxed = draw(st.booleans())
        for place, name in enumerate(names):
            bits = min(draw(st.integers(1, 20)), 8 * length - bit)
            if bits < 1:
                break
            kind = "" if not muxed else " M" if place == 0 else f" m{draw(st.integers(0, 1))}"
            sign, scale = draw(st.sampled_from("+-")), draw(st.sampled_from(["1", "0.01", "-0.5", "1E-06"]))
            offset, unit = draw(st.sampled_from(["0", "-3.5", "100"])), draw(st.sampled_from(["", *UNITS]))
            high = draw(st.sampled_from(["0", "1", "1E9"]))
            text += f' SG_ {name}{kind} : {bit}|{bits}@1{sign} ({scale},{offset}) [0|{high}] "{unit}" ECU\n'
            bit += bits
            if table := draw(st.sampled_from(TABLES)):
                tables += f"VAL_ {number} {name} {table};\n"
    return text + tables


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=databases())
def test_whatever_lanes_a_database_has_its_skeleton_loads_and_can_be_sent(tmp_path, text):
    refused = ""
    try:
        found, profile = of_dbc(tmp_path, text)
    except ConfigError as error:
        refused = str(error)
    if refused:
        assert "has a lane or motion by its name" in refused
        return
    assert found.mapped == len(signals_of(found.text))
    assert profile.role == "vehicle" or Sender(profile, camera_x_m=1.9)(values())


def signals_of(text):
    messages = tomllib.loads(text)["messages"].values()
    return [name for message in messages for name in message.get("signals", {})]


# --- the command ------------------------------------------------------------------------------------------


def test_without_out_the_profile_is_printed_and_names_the_database_from_here(capsys, tmp_path, monkeypatch):
    (tmp_path / "lanes.dbc").write_text(HEAD + LINE)
    monkeypatch.chdir(tmp_path)
    status, out, err = vsensor(capsys, "profile", "new", "lanes.dbc")
    assert status == 0
    assert tomllib.loads(out)["database"] == "lanes.dbc"
    assert_one_line(err, "1 messages, 1 signals mapped")


def test_a_profile_in_another_folder_finds_its_database(capsys, tmp_path):
    (tmp_path / "lanes.dbc").write_text(HEAD + LINE)
    (tmp_path / "deep").mkdir()
    out = tmp_path / "deep" / "mine.toml"
    assert vsensor(capsys, "profile", "new", tmp_path / "lanes.dbc", "--out", out)[0] == 0
    assert load_profile(out).database.resolve() == (tmp_path / "lanes.dbc").resolve()


def test_a_file_that_is_there_is_kept_unless_it_is_forced(capsys, tmp_path):
    (tmp_path / "lanes.dbc").write_text(HEAD + LINE)
    out = tmp_path / "mine.toml"
    out.write_text("work of hours")
    words = ("profile", "new", tmp_path / "lanes.dbc", "--out", out)
    status, _, err = vsensor(capsys, *words)
    assert status == 2
    assert_one_line(err, str(out), "is there already", "--force")
    assert out.read_text() == "work of hours"
    assert vsensor(capsys, *words, "--force")[0] == 0
    assert load_profile(out)


@pytest.mark.parametrize(
    ("dbc", "words", "said"),
    [
        (LINE, ("--node", "CAMM"), "node 'CAMM' sends no message; did you mean CAM?"),
        (LINE, ("--role", "vehicle"), "none of 1 messages has motion of the vehicle by its name"),
        (LINE, ("--out", "mine.txt"), "a profile ends in .toml"),
        (LINE, ("--out", "nowhere/mine.toml"), "cannot be written: No such file or directory"),
        (LINE.replace("8 CAM", "8 CAM ?"), (), "cantools refuses it"),
        ("", (), "none of 0 messages has a lane or motion by its name"),
    ],
)
def test_what_cannot_be_is_one_line_and_exit_2(capsys, tmp_path, monkeypatch, dbc, words, said):
    (tmp_path / "lanes.dbc").write_text(HEAD + dbc)
    monkeypatch.chdir(tmp_path)
    status, _, err = vsensor(capsys, "profile", "new", "lanes.dbc", *words)
    assert status == 2
    assert_one_line(err, said)
