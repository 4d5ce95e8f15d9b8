"""When messages are sent, from the words of databases and profiles."""

import pytest

from vsensor.check import check_file
from vsensor.errors import ConfigError
from vsensor.profile import load_profile
from vsensor.profile.send_plan import Trigger, trigger_of
from vsensor.profile.sending import Condition, SendPlan

MS = 1_000_000
CYCLIC, CHANGE, WRITE = Trigger(cyclic=True), Trigger(on_change=True), Trigger(on_write=True)
BOTH, ACTIVE = Trigger(cyclic=True, on_change=True), Trigger(if_active=True)


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("Cyclic cyclic cyclicX Cycle Periodic FixedPeriodic Cyclical", CYCLIC),
        ("Event OnChange Spontaneous spontanX triggered OnEvent sporadic", CHANGE),
        ("CyclicAndEvent CyclicAndSpontan cyclicAndTriggered EventPeriodic EventAndPeriodic CE Mixed", BOTH),
        ("OnWrite", WRITE),
        ("IfActive CyclicIfActive cyclicIfActiveX EnabledPeriodic CA CyclicIfActiveFast", ACTIVE),
        (
            "cyclicIfActiveAndTriggered CyclicIfActiveAndSpontaneousWD",
            Trigger(if_active=True, on_change=True),
        ),
        ("OnChangeWithRepetition SpontaneousWithRepetitionWD", Trigger(on_change=True, repeated=True)),
        ("OnWriteWithRepetition", Trigger(on_write=True, repeated=True)),
        ("IfActiveWithRepetition", Trigger(if_active=True, repeated=True)),
        ("OnChangeAndIfActive", Trigger(on_change=True, if_active=True)),
        ("NoMsgSendType NoSigSendType none NotUsed not_used vector_leerstring reserved", Trigger()),
        ("Whenever Sometimes CyclicOrSo WithRepetition", None),
    ],
)
def test_the_makers_words_for_send_types_are_understood(words, meant):
    assert {word: trigger_of(word) for word in words.split()} == dict.fromkeys(words.split(), meant)


DATABASE = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 1 M: 8 A
 SG_ Off : 0|16@1- (0.01,0) [0|0] "m" B
 SG_ State : 16|8@1+ (2,10) [0|0] "" B
 SG_ Index : 24|8@1+ (1,0) [0|0] "" B
BA_DEF_ BO_ "GenMsgSendType" ENUM "Cyclic","Event","CyclicAndSpontanX","IfActive","NoMsgSendType","Odd";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 60000;
BA_DEF_ BO_ "GenMsgCycleTimeFast" INT 0 60000;
BA_DEF_ BO_ "GenMsgDelayTime" INT 0 60000;
BA_DEF_ BO_ "GenMsgStartDelayTime" INT 0 60000;
BA_DEF_ BO_ "GenMsgNrOfRepetition" INT 0 100;
BA_DEF_ SG_ "GenSigSendType" ENUM "Cyclic","OnWrite","OnChangeWithRepetition","IfActive","NoSigSendType";
BA_DEF_ SG_ "GenSigInactiveValue" INT 0 255;
BA_DEF_DEF_ "GenMsgSendType" "NoMsgSendType";
BA_DEF_DEF_ "GenMsgCycleTime" 100;
BA_DEF_DEF_ "GenMsgCycleTimeFast" 0;
BA_DEF_DEF_ "GenMsgDelayTime" 20;
BA_DEF_DEF_ "GenMsgStartDelayTime" 0;
BA_DEF_DEF_ "GenMsgNrOfRepetition" 3;
BA_DEF_DEF_ "GenSigSendType" "NoSigSendType";
BA_DEF_DEF_ "GenSigInactiveValue" 0;
"""
PROFILE = """schema = "vsensor.profile/1"
database = "own.dbc"
{top}
[messages.M]
{keys}
[messages.M.signals]
Off = "left.offset_m"
State = {{ quantity = "sensor.state", shift = 10 }}
Index = {{ quantity = "image.index", wrap = true }}
"""


def plan_of(tmp_path, attributes="", keys="", top=""):
    (tmp_path / "own.dbc").write_text(DATABASE + attributes)
    (tmp_path / "own.toml").write_text(PROFILE.format(keys=keys, top=top))
    return load_profile(tmp_path / "own.toml").messages[0].sending


def message(name, value):
    return f'BA_ "{name}" BO_ 1 {value};\n'


def signal(name, which, value):
    return f'BA_ "{name}" SG_ 1 {which} {value};\n'


ACTIVE_STATE = Condition(subject="State", is_signal=True, word="!=", bound=16.0)


@pytest.mark.parametrize(
    ("attributes", "expected"),
    [
        ("", SendPlan(cycle_ns=100 * MS)),
        (message("GenMsgSendType", 0) + message("GenMsgCycleTime", 50), SendPlan(cycle_ns=50 * MS)),
        (message("GenMsgStartDelayTime", 30), SendPlan(cycle_ns=100 * MS, offset_ns=30 * MS)),
        (
            message("GenMsgSendType", 1),
            SendPlan(cycle_ns=0, on_change=True, watched=("Off", "State"), min_delay_ns=20 * MS),
        ),
        (
            message("GenMsgSendType", 2) + message("GenMsgDelayTime", 0),
            SendPlan(cycle_ns=100 * MS, on_change=True, watched=("Off", "State")),
        ),
        (
            signal("GenSigSendType", "State", 2) + message("GenMsgCycleTimeFast", 10),
            SendPlan(
                cycle_ns=100 * MS,
                on_change=True,
                watched=("State",),
                repetitions=3,
                repetition_ns=10 * MS,
                min_delay_ns=20 * MS,
            ),
        ),
        (
            signal("GenSigSendType", "State", 3)
            + signal("GenSigInactiveValue", "State", 3)
            + message("GenMsgCycleTimeFast", 10)
            + message("GenMsgDelayTime", 0),
            SendPlan(cycle_ns=100 * MS, fast_cycle_ns=10 * MS, active=(ACTIVE_STATE,)),
        ),
    ],
)
def test_the_attributes_of_the_database_make_the_plan(tmp_path, attributes, expected):
    assert plan_of(tmp_path, attributes) == expected


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("cycle_ms = 40", SendPlan(cycle_ns=40 * MS)),
        (
            "cycle_ms = 40\nstart_delay_ms = 5\nsend = { phase_ms = 10 }",
            SendPlan(cycle_ns=40 * MS, offset_ns=15 * MS),
        ),
        (
            'send = { type = "on_change", watch = ["Off"], repetitions = 2, repetition_ms = 7, '
            "min_delay_ms = 3 }",
            SendPlan(
                cycle_ns=0,
                on_change=True,
                watched=("Off",),
                repetitions=2,
                repetition_ns=7 * MS,
                min_delay_ns=3 * MS,
            ),
        ),
        ('send = { type = "on_write", min_delay_ms = 0 }', SendPlan(cycle_ns=0, on_write=True)),
        (
            'send = { type = "if_active", active = "lane.change != 0", min_delay_ms = 0 }',
            SendPlan(
                cycle_ns=0,
                fast_cycle_ns=100 * MS,
                active=(Condition(subject="lane.change", is_signal=False, word="!=", bound=0.0),),
            ),
        ),
        (
            'send = { type = "cyclic", fast_cycle_ms = 10, active = "State>=12", min_delay_ms = 0 }',
            SendPlan(
                cycle_ns=100 * MS,
                fast_cycle_ns=10 * MS,
                active=(Condition(subject="State", is_signal=True, word=">=", bound=12.0),),
            ),
        ),
    ],
)
def test_the_profile_says_it_where_the_database_does_not(tmp_path, keys, expected):
    assert plan_of(tmp_path, keys=keys) == expected


def test_a_cycle_in_the_profile_makes_a_message_cyclic_whatever_the_database_says(tmp_path):
    assert plan_of(tmp_path, message("GenMsgSendType", 1), "cycle_ms = 40") == SendPlan(cycle_ns=40 * MS)


def test_the_messages_of_a_group_have_its_phase(tmp_path):
    top = '[groups.lanes]\nmessages = ["M"]\nphase_ms = 12'
    assert plan_of(tmp_path, top=top).offset_ns == 12 * MS
    assert plan_of(tmp_path, keys="send = { phase_ms = 4 }", top=top).offset_ns == 4 * MS


def test_an_unknown_word_is_a_finding_and_counts_as_cyclic(tmp_path):
    plan = plan_of(tmp_path, message("GenMsgSendType", 5))
    assert plan.is_cyclic
    assert plan.findings == ("M: send type 'Odd' is not known and counts as cyclic",)


def test_a_message_sent_while_active_of_which_nothing_says_when_is_a_finding_and_cyclic(tmp_path):
    plan = plan_of(tmp_path, message("GenMsgSendType", 3))
    assert (plan.cycle_ns, plan.is_cyclic, len(plan.findings)) == (100 * MS, True, 1)


@pytest.mark.parametrize(
    ("keys", "top", "said"),
    [
        ("cycle_ms = 40\nsend = { cycle_ms = 50 }", "", "cycle_ms stands twice"),
        ("send = { fast_cycle_ms = 10 }", "", "send.active"),
        ('send = { type = "if_active" }', "", "send.active"),
        (
            'send = { type = "if_active", active = "Stale != 0" }',
            "",
            "neither a quantity nor a signal.*State",
        ),
        ('send = { type = "if_active", active = "State is 0" }', "", "NAME OPERATOR NUMBER"),
        ('send = { type = "if_active", active = "State > much" }', "", "NAME OPERATOR NUMBER"),
        ('send = { type = "on_change", watch = ["Offf"] }', "", "Offf is no signal.*Off"),
        ('send = { type = "sometimes" }', "", "send.type"),
        ("", '[groups.a]\nmessages = ["N"]', "N is no message of this profile"),
        ("", '[groups.a]\nmessages = ["M"]\n[groups.b]\nmessages = ["M"]', "in another group"),
    ],
)
def test_what_does_not_fit_together_is_one_line_that_names_it(tmp_path, keys, top, said):
    with pytest.raises(ConfigError, match=said) as error:
        plan_of(tmp_path, keys=keys, top=top)
    assert "own.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_check_says_how_messages_leave_and_what_it_did_not_understand(tmp_path):
    plan_of(tmp_path, message("GenMsgSendType", 5), 'send = { active = "State != 0", fast_cycle_ms = 10 }')
    report = check_file(str(tmp_path / "own.toml"))
    assert any(
        "bytes every 100 ms and every 10 ms while active, 3 quantities" in line for line in report.lines
    )
    assert "M: send type 'Odd' is not known and counts as cyclic" in report.findings
