"""Short runs with faults, tick by tick, and what a receiver makes of them."""

from dataclasses import replace
from functools import cache

from vsensor.config import load_scenario
from vsensor.e2e import ReceiverConfig, ReceiverState, receive
from vsensor.faults import FaultConfig, faults_of
from vsensor.line import build_line
from vsensor.types import Tick

PERIOD_NS = 40_000_000
AT_S = 0.8
"""When the faults of these tests begin: tick 20, all lines are reported by then."""

FIRST = 20
TICKS = 45


QUICK = {"state": {"init_s": 0.0}, "camera": {"model": "none", "occlusion": "none"}, "traffic": []}
"""Lines are reported after three images, and what the camera would compute, which no fault knows, is not."""


@cache
def line(**output):
    """Return the shipped drive."""
    return build_line(load_scenario("highway", QUICK | {"output": output}))


def with_faults(*told, of=None):
    """Return a line whose timeline has these faults, from AT_S unless they say otherwise."""
    of = of or line()
    configs = [FaultConfig(**{"at_s": AT_S, **one}) for one in told]
    return replace(of, timeline=faults_of(configs, of.profile))


def tick(index):
    return Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)


def run(of, ticks=TICKS, state=None, first=0, commands=None):
    """Return the outputs of the ticks `first` to `ticks` - 1, and the state after them."""
    state, outputs = state or of.initial_state(), []
    for index in range(first, ticks):
        computed = of.compute(state, tick(index), commands=(commands or {}).get(index, ()))
        state = computed.state_if_sent
        outputs.append(computed.output)
    return outputs, state


@cache
def _plain(of_key):
    return run(line(**dict(of_key)))[0]


def plain(**output):
    """Return the outputs without a fault."""
    return _plain(tuple(output.items()))


def faulty(*told, ticks=TICKS):
    """Return the outputs of a run with these faults in its timeline."""
    return run(with_faults(*told), ticks)[0]


def plan(name, of=None):
    """Return a message of the profile."""
    return next(plan for plan in (of or line()).profile.messages if plan.layout.name == name)


def frames_of(outputs, name):
    """Return the frames of one message, a list for each tick."""
    number = plan(name).layout.arbitration_id
    return [[frame for frame in output.frames if frame.arbitration_id == number] for output in outputs]


def others(outputs, name):
    """Return the frames of all other messages, tick by tick."""
    number = plan(name).layout.arbitration_id
    return [[frame for frame in output.frames if frame.arbitration_id != number] for output in outputs]


def data_of(outputs, name):
    """Return the data of the one frame that a message has in each tick, None where it has none."""
    return [frames[0].data if frames else None for frames in frames_of(outputs, name)]


def counters(outputs, name):
    """Return the alive counter of a message in each tick, None where it is not there."""
    guard = plan(name).guard
    return [None if data is None else guard.counter(data) for data in data_of(outputs, name)]


def judged(outputs, name):
    """Return what a receiver concludes, cycle by cycle: every frame of it, or that none came."""
    guard, state, checks = plan(name).guard, ReceiverState(), []
    for frames in frames_of(outputs, name):
        for data in [frame.data for frame in frames] or [None]:
            state, check = receive(ReceiverConfig(), state, guard, data)
            checks.append(check)
    return checks


def statuses(outputs, name):
    """Return the words of what a receiver concludes from FIRST on, as far as it is not OK all the rest."""
    words = [check.status.value for check in judged(outputs, name)][FIRST:]
    while words and words[-1] == "ok":
        words.pop()
    return words


def is_valid_at_end(outputs, name):
    return judged(outputs, name)[-1].reception.value == "valid"
