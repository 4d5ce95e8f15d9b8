"""ARXML, KCD and SYM files are as good as a DBC: the same profile, the same frames."""

import cantools
import pytest

from tests.made_profiles import HEAD, raws, sent, values
from vsensor.codec import load_database
from vsensor.profile import load_profile

DBC = (
    HEAD + 'BO_ 291 Lane: 8 CAM\n SG_ Off : 3|16@1- (0.002,0) [-65.536|65.534] "m" ECU\n'
    ' SG_ Kind : 24|4@1+ (1,0) [0|15] "" ECU\n SG_ Far : 39|10@0+ (0.25,0) [0|255.75] "m" ECU\n'
    'VAL_ 291 Kind 0 "NOTHING" 1 "SOLID_LINE" 2 "DASHED_LINE" ;\n'
    'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    'BA_ "GenMsgCycleTime" BO_ 291 40;\n'
)
PROFILE = (
    'schema = "vsensor.profile/1"\ndatabase = "lanes{suffix}"\n[messages.Lane]\ncycle_ms = 40\n'
    '[messages.Lane.signals]\nOff = "left.offset_m"\nFar = "left.x_max_m"\n'
    'Kind = {{ quantity = "left.kind", table = "kinds" }}\n'
    '[tables.kinds]\nsolid = "SOLID_LINE"\ndashed = "DASHED_LINE"\nother = 0\n'
)

ARXML = """<?xml version="1.0" encoding="UTF-8"?>
<AUTOSAR xmlns="http://autosar.org/schema/r4.0"><AR-PACKAGES><AR-PACKAGE><SHORT-NAME>P</SHORT-NAME><ELEMENTS>
<CAN-CLUSTER><SHORT-NAME>Bus</SHORT-NAME><CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL><PHYSICAL-CHANNELS>
<CAN-PHYSICAL-CHANNEL><SHORT-NAME>Ch</SHORT-NAME><FRAME-TRIGGERINGS><CAN-FRAME-TRIGGERING>
<SHORT-NAME>T</SHORT-NAME><FRAME-REF DEST="CAN-FRAME">/P/LaneFrame</FRAME-REF>
<CAN-ADDRESSING-MODE>STANDARD</CAN-ADDRESSING-MODE><IDENTIFIER>291</IDENTIFIER>
</CAN-FRAME-TRIGGERING></FRAME-TRIGGERINGS></CAN-PHYSICAL-CHANNEL></PHYSICAL-CHANNELS>
</CAN-CLUSTER-CONDITIONAL></CAN-CLUSTER-VARIANTS></CAN-CLUSTER>
<CAN-FRAME><SHORT-NAME>LaneFrame</SHORT-NAME><FRAME-LENGTH>8</FRAME-LENGTH><PDU-TO-FRAME-MAPPINGS>
<PDU-TO-FRAME-MAPPING><SHORT-NAME>M</SHORT-NAME><PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER>
<PDU-REF DEST="I-SIGNAL-I-PDU">/P/LanePdu</PDU-REF><START-POSITION>0</START-POSITION></PDU-TO-FRAME-MAPPING>
</PDU-TO-FRAME-MAPPINGS></CAN-FRAME>
<I-SIGNAL-I-PDU><SHORT-NAME>LanePdu</SHORT-NAME><LENGTH>8</LENGTH><I-SIGNAL-TO-PDU-MAPPINGS>
<I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>MapCrc</SHORT-NAME><I-SIGNAL-REF DEST="I-SIGNAL">/P/Crc</I-SIGNAL-REF>
<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER><START-POSITION>0</START-POSITION>
</I-SIGNAL-TO-I-PDU-MAPPING>
<I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>MapCnt</SHORT-NAME><I-SIGNAL-REF DEST="I-SIGNAL">/P/Cnt</I-SIGNAL-REF>
<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER><START-POSITION>8</START-POSITION>
</I-SIGNAL-TO-I-PDU-MAPPING>
<I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>MapOff</SHORT-NAME><I-SIGNAL-REF DEST="I-SIGNAL">/P/Off</I-SIGNAL-REF>
<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER><START-POSITION>19</START-POSITION>
</I-SIGNAL-TO-I-PDU-MAPPING></I-SIGNAL-TO-PDU-MAPPINGS></I-SIGNAL-I-PDU>
<I-SIGNAL-I-PDU-GROUP><SHORT-NAME>G</SHORT-NAME></I-SIGNAL-I-PDU-GROUP>
<I-SIGNAL><SHORT-NAME>Crc</SHORT-NAME><LENGTH>8</LENGTH>
<SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/SCrc</SYSTEM-SIGNAL-REF></I-SIGNAL>
<I-SIGNAL><SHORT-NAME>Cnt</SHORT-NAME><LENGTH>4</LENGTH>
<SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/SCnt</SYSTEM-SIGNAL-REF></I-SIGNAL>
<I-SIGNAL><SHORT-NAME>Off</SHORT-NAME><LENGTH>16</LENGTH>
<SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/SOff</SYSTEM-SIGNAL-REF></I-SIGNAL>
<SYSTEM-SIGNAL><SHORT-NAME>SCrc</SHORT-NAME></SYSTEM-SIGNAL>
<SYSTEM-SIGNAL><SHORT-NAME>SCnt</SHORT-NAME></SYSTEM-SIGNAL>
<SYSTEM-SIGNAL><SHORT-NAME>SOff</SHORT-NAME></SYSTEM-SIGNAL>
<END-TO-END-PROTECTION-SET><SHORT-NAME>E2E</SHORT-NAME><END-TO-END-PROTECTIONS><END-TO-END-PROTECTION>
<SHORT-NAME>LaneE2E</SHORT-NAME><END-TO-END-PROFILE><CATEGORY>PROFILE_01</CATEGORY>
<DATA-IDS><DATA-ID>1234</DATA-ID></DATA-IDS>
</END-TO-END-PROFILE><END-TO-END-PROTECTION-I-SIGNAL-I-PDUS><END-TO-END-PROTECTION-I-SIGNAL-I-PDU>
<I-SIGNAL-I-PDU-REF DEST="I-SIGNAL-I-PDU">/P/LanePdu</I-SIGNAL-I-PDU-REF>
</END-TO-END-PROTECTION-I-SIGNAL-I-PDU></END-TO-END-PROTECTION-I-SIGNAL-I-PDUS>
</END-TO-END-PROTECTION></END-TO-END-PROTECTIONS></END-TO-END-PROTECTION-SET>
</ELEMENTS></AR-PACKAGE></AR-PACKAGES></AUTOSAR>
"""


def written(tmp_path, suffix):
    """Write the same lanes in another format, as cantools writes it."""
    database = cantools.database.load_string(DBC, "dbc")
    if suffix == ".dbc":
        (tmp_path / "lanes.dbc").write_text(DBC)
    else:
        cantools.database.dump_file(database, str(tmp_path / f"lanes{suffix}"))
    path = tmp_path / f"lanes{suffix}.toml"
    path.write_text(PROFILE.format(suffix=suffix))
    return path


@pytest.mark.parametrize("suffix", [".kcd", ".sym"])
def test_a_profile_works_alike_on_every_format(tmp_path, suffix):
    profile, of_dbc = (load_profile(written(tmp_path, kind)) for kind in (suffix, ".dbc"))
    frames = sent(profile, values())
    assert [frame.data for frame in frames] == [frame.data for frame in sent(of_dbc, values())]
    assert profile.decode(frames[0]) == of_dbc.decode(frames[0])
    assert raws(profile, frames)[0]["Off"] == 900


def test_an_arxml_says_how_its_frames_are_protected(tmp_path):
    (tmp_path / "lanes.arxml").write_text(ARXML)
    layout = load_database(tmp_path / "lanes.arxml").layouts["LaneFrame"]
    assert (layout.e2e_profile, layout.e2e_data_id) == ("P01", 1234)
    path = tmp_path / "lanes.toml"
    path.write_text(
        'schema = "vsensor.profile/1"\ndatabase = "lanes.arxml"\n[messages.LaneFrame]\ncycle_ms = 40\n'
        'e2e = { crc = "Crc", counter = "Cnt" }\n[messages.LaneFrame.signals]\n'
        'Off = { quantity = "left.offset_m", factor = 500 }\n'
    )
    profile = load_profile(path)
    frame = sent(profile, values())[0]
    assert raws(profile, [frame])[0]["Off"] == 900
    assert profile.decode(frame, check=True) == {"left.offset_m": 1.8}
