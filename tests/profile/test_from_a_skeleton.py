"""A tester with a new maker's database and no Python: skeleton, answers to its marks, run, accept, decode."""

import re

import cantools
import pytest

from tests.made_profiles import HEAD
from tests.test_cli import vsensor

TIED = (
    ' SG_ BurstIdent : 7|3@0+ (1,0) [0|7] "" ECU\n SG_ RollingCount : 4|5@0+ (1,0) [0|31] "" ECU\n'  # in all
)


def nord():
    """Seven Motorola frames: distances without sign, validity bits where 0 is valid, a CRC over the burst."""
    text, more = "", ""
    for place, (name, side) in enumerate((("Lft", "left"), ("Rgt", "right"))):
        first = 0x410 + 2 * place
        text += (
            f"BO_ {first} NL_{name}Geo: 8 CAM\n{TIED}"
            f' SG_ {name}LnDist : 15|13@0+ (0.005,0) [0|40.955] "m" ECU\n'
            f' SG_ {name}LnDistInv : 18|1@0+ (1,0) [0|1] "" ECU\n'
            f' SG_ {name}LnHdg : 17|11@0- (0.5,0) [-512|511.5] "mrad" ECU\n'
            f' SG_ {name}LnQual : 38|7@0+ (1,0) [0|100] "%" ECU\n'
            f' SG_ {name}LnType : 45|3@0+ (1,0) [0|7] "" ECU\n'
            f"BO_ {first + 1} NL_{name}Shape: 7 CAM\n{TIED}"
            f' SG_ {name}LnCrv : 13|14@0- (0.01,0) [-81.92|81.91] "1/km" ECU\n'
            f' SG_ {name}LnViewEnd : 42|9@0+ (0.5,0) [0|255.5] "m" ECU\n'
        )
        more += (
            f'CM_ SG_ {first} {name}LnDist "From the bumper to the inner edge of the {side} line";\n'
            f'CM_ SG_ {first} {name}LnHdg "Heading angle of the {side} line, positive to the right";\n'
            f'VAL_ {first} {name}LnType 0 "NONE" 1 "SOLID" 2 "BROKEN" 3 "DOUBLE_SOLID" 5 "OTHER" ;\n'
            f'VAL_ {first} {name}LnDist 8191 "SNA" 8190 "Fault" 8189 "Init" ;\n'
            f'VAL_ {first} {name}LnDistInv 0 "Valid" 1 "Invalid" ;\n'
            f'VAL_ {first + 1} {name}LnViewEnd 511 "SNA" ;\n'
        )
    text += (
        f'BO_ 1044 NL_Lane: 6 CAM\n{TIED} SG_ LaneWidth : 14|10@0+ (1,0) [0|1023] "cm" ECU\n'
        ' SG_ LaneWidthNotAvl : 20|1@0+ (1,0) [0|1] "" ECU\n SG_ ImgCtr : 31|16@0+ (1,0) [0|65535] "" ECU\n'
        f'BO_ 1045 NL_Sensor: 4 CAM\n{TIED} SG_ CamState : 15|4@0+ (1,0) [0|15] "" ECU\n'
        f'BO_ 1046 NL_BurstEnd: 4 CAM\n{TIED} SG_ BurstCrc : 15|16@0+ (1,0) [0|65535] "" ECU\n'
    )
    more += (
        'VAL_ 1044 LaneWidth 1023 "SNA" ;\nVAL_ 1044 LaneWidthNotAvl 0 "Available" 1 "NotAvailable" ;\n'
        'VAL_ 1045 CamState 0 "BOOT" 1 "CALIB" 2 "OK" 3 "LIMITED" 4 "BLINDED" 15 "DEFECT" ;\n'
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;\nBA_DEF_DEF_ "GenMsgCycleTime" 50;\n'
    )
    return HEAD + text + more


LINES = (("Host_L", "left"), ("Host_R", "right"), ("Adj_L", "next_left"), ("Adj_R", "next_right"))


def sol():
    """A line on each page of a CAN FD message of 48 bytes, in either byte order, a float; E2E P05."""
    identifier, more = 0x98FEF001, ""
    text = (
        f'BO_ {identifier} SOL_Lines: 48 CAM\n SG_ Sol_CS : 0|16@1+ (1,0) [0|65535] "" ECU\n'
        ' SG_ Sol_MsgCnt : 16|8@1+ (1,0) [0|255] "" ECU\n SG_ Sol_LineSel M : 24|2@1+ (1,0) [0|3] "" ECU\n'
        ' SG_ Sol_ImgId : 26|6@1+ (1,0) [0|63] "" ECU\n'
    )
    for page, (name, _) in enumerate(LINES):
        text += (
            f' SG_ {name}_C0 m{page} : 39|16@0- (0.002,0) [-40|40] "m" ECU\n'
            f' SG_ {name}_C1 m{page} : 52|13@0- (0.0005,0) [-1|1] "" ECU\n'
            f' SG_ {name}_C2 m{page} : 71|18@0- (1E-06,0) [0|0] "1/m" ECU\n'
            f' SG_ {name}_C3 m{page} : 88|32@1- (1,0) [0|0] "1/m2" ECU\n'
            f' SG_ {name}_Marker m{page} : 141|3@1+ (1,0) [0|7] "" ECU\n'
            f' SG_ {name}_Detected m{page} : 144|1@1+ (1,0) [0|1] "" ECU\n'
        )
        more += (
            f'CM_ SG_ {identifier} {name}_C0 "x from the front axle, y left, centre of the marking";\n'
            f'VAL_ {identifier} {name}_Marker 0 "None" 1 "Continuous" 2 "Dashed" 4 "RoadEdge" 7 "Unknown" ;\n'
            f"SIG_VALTYPE_ {identifier} {name}_C3 : 1;\n"
        )
    more += (
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;\nBA_DEF_DEF_ "GenMsgCycleTime" 20;\n'
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","StandardCAN_FD","ExtendedCAN_FD";\n'
        f'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\nBA_ "VFrameFormat" BO_ {identifier} 3;\n'
    )
    return HEAD + text + more


def uncommented(text):
    """Take the comment signs from what is proposed about bursts, as its mark asks for."""
    place = text.index("# [bursts.")
    return text[:place] + re.sub(r"^# ", "", text[place:], flags=re.MULTILINE)


def answered_nord(text):
    answers = ('algorithm = "crc16_ccitt"', 'algorithm = "crc16_ccitt"\ndata_id = 0x4E4C')
    return uncommented(text).replace(*answers)


def answered_sol(text):
    return text.replace("data_id = 0 }", "data_id = 0x0F1E }").replace('mux = "together"', 'mux = "rotate"')


class Bench:
    """The commands that a tester types, in a folder of its own."""

    def __init__(self, capsys, folder, database, answered):
        self.capsys, self.profile, self.log = capsys, folder / "mine.toml", folder / "mine.log"
        self.database = folder / "maker.dbc"
        self.database.write_text(database)
        self("profile", "new", self.database, "--out", self.profile)
        text = self.profile.read_text()
        assert self("check", self.profile, status=1).count("finding: mine.toml line") == text.count("#? ")
        self.profile.write_text(answered(text).replace("#? ", "# "))
        assert "no findings" in self("check", self.profile)
        self("run", "--fast", "--duration", 2, "--profile", self.profile, "--log", self.log)

    def __call__(self, *words, status=0):
        found, out, err = vsensor(self.capsys, *words)
        assert found == status, out + err
        return out

    def accepted(self):
        return self("accept", self.log, "--profile", self.profile)

    def rows(self):
        """Return what `decode` tells, a dict of numbers for each row."""
        lines = self("decode", self.log, "--profile", self.profile, "--csv").splitlines()
        names, *rows = [line.split(",") for line in lines if line and not line.startswith("#")]
        return [{n: float(v) for n, v in zip(names, row, strict=True) if v} for row in rows]

    def frames(self):
        """Return (identifier, data) of every frame of the log."""
        sent = []
        for line in self.log.read_text().splitlines():
            name, _, data = line.split()[2].partition("#")
            sent.append((int(name, 16), bytes.fromhex(data[2:] if data.startswith("#") else data)))
        return sent

    def by_cantools(self):
        """Return (name, signals) of every frame, as cantools reads the maker's database."""
        database = cantools.database.load_file(self.database)
        return [
            (database.get_message_by_frame_id(i).name, database.decode_message(i, d, decode_choices=False))
            for i, d in self.frames()
        ]


@pytest.fixture
def nord_bench(capsys, tmp_path):
    return Bench(capsys, tmp_path, nord(), answered_nord)


@pytest.fixture
def sol_bench(capsys, tmp_path):
    return Bench(capsys, tmp_path, sol(), answered_sol)


def crc16(data):
    """CRC-16 CCITT-FALSE, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (0x1021 if crc & 0x8000 else 0)
    return crc & 0xFFFF


def test_seven_motorola_frames_with_one_checksum_are_accepted_and_come_back(nord_bench):
    assert "accepted" in nord_bench.accepted()
    rows = nord_bench.rows()
    assert [row["image.index"] for row in rows] == [50 * k // 40 for k in range(40)]
    for row in rows[8:]:
        assert row["right.offset_m"] < -1 < 1 < row["left.offset_m"]
        assert row["left.offset_m"] - row["right.offset_m"] == pytest.approx(row["lane.width_m"], abs=0.02)
        assert row["left.quality"] <= 4


def test_its_burst_crc_and_count_are_right_by_a_reader_of_its_own(nord_bench):
    frames = nord_bench.frames()
    bursts = [frames[k : k + 7] for k in range(0, len(frames), 7)]
    assert len(bursts) == 40
    for count, burst in enumerate(bursts):
        assert [identifier for identifier, _ in burst] == [*range(0x410, 0x417)]
        assert {data[0] for _, data in burst} == {(50 * count // 40 % 8) << 5 | count % 32}
        last = burst[-1][1]
        covered = b"".join(data for _, data in burst[:-1]) + last[:1] + last[3:]
        assert int.from_bytes(last[1:3], "big") == crc16(b"\x4c\x4e" + covered)


def test_its_bits_are_zero_while_valid_and_its_distances_have_no_sign_as_cantools_reads(nord_bench):
    told = {}
    for name, signals in nord_bench.by_cantools():
        told.setdefault(name, []).append(signals)
    for name, rows in (("Lft", told["NL_LftGeo"]), ("Rgt", told["NL_RgtGeo"])):
        assert [row[f"{name}LnDistInv"] for row in rows][:4] == [1] * 4  # while the sensor starts
        assert {row[f"{name}LnDistInv"] for row in rows[8:]} == {0}
        assert all(1 < row[f"{name}LnDist"] < 3 for row in rows[8:])
        assert {round(row[f"{name}LnDist"] / 0.005) for row in rows[:4]} == {8189}  # init


def test_lines_on_pages_of_can_fd_are_accepted_and_come_back_as_cantools_reads_them(sol_bench):
    assert "accepted" in sol_bench.accepted()
    read = sol_bench.by_cantools()
    assert [signals["Sol_LineSel"] for _, signals in read] == [k % 4 for k in range(100)]
    assert [signals["Sol_MsgCnt"] for _, signals in read] == [*range(100)]
    for row, (_, signals) in zip(sol_bench.rows(), read, strict=True):
        name, line = LINES[int(signals["Sol_LineSel"])]
        shown = (
            row[f"{line}.{what}"] for what in ("available", "offset_m", "heading", "c2_per_m", "c3_per_m2")
        )
        sent = (signals[f"{name}_{what}"] for what in ("Detected", "C0", "C1", "C2", "C3"))
        assert tuple(shown) == pytest.approx(tuple(sent), rel=1e-6, abs=1e-12)
    assert any(signals.get("Host_L_Detected") and signals["Host_L_C0"] > 1 for _, signals in read)
