"""What can be wrong with a stream: names, and what an ECU that reads it would do; the worst first."""

from collections.abc import Mapping
from typing import Literal

Kind = Literal[
    "never_heard",
    "wrong_length",
    "wrong_crc",
    "e2e_invalid",
    "missing",
    "wrong_cycle",
    "counter_repeated",
    "counter_jumped",
    "image_frozen",
    "image_backwards",
    "burst_checksum",
    "burst_mixed",
    "burst_incomplete",
    "burst_order",
    "contradiction",
    "jump",
    "stuck",
    "out_of_range",
    "extra",
    "too_close",
    "late",
]

CONSUMER: Mapping[Kind, str] = {
    "never_heard": "times out and never works",
    "wrong_length": "drops the frame",
    "wrong_crc": "drops the frame",
    "e2e_invalid": "trusts none of the message until it is valid again",
    "missing": "goes on with old values, times out after some in a row",
    "wrong_cycle": "sees late frames or too many, all the time",
    "counter_repeated": "drops the frame as an old one",
    "counter_jumped": "counts lost frames, drops the frame where the step is too large",
    "image_frozen": "steers by an old image",
    "image_backwards": "takes it for a restart of the sensor",
    "burst_checksum": "drops the whole image",
    "burst_mixed": "drops the image, or mixes two",
    "burst_incomplete": "drops the image, or keeps old values for the rest",
    "burst_order": "may take the image for two incomplete ones",
    "contradiction": "believes one of the two",
    "jump": "filters it out, or steers with a jerk",
    "stuck": "steers by an old value",
    "out_of_range": "clips it, or takes it for a fault",
    "extra": "hears two senders, or repeats",
    "too_close": "is overrun",
    "late": "works with old values meanwhile",
}
"""Kind -> what a consumer does about it; in the order in which they are shown."""
