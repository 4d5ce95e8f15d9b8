"""Frames of a stream through a repair, without a player."""

from msgspec.structs import replace

from vsensor.profile import load_profile
from vsensor.replay.repair import Repair
from vsensor.replay.stages import Chain

NATIVE = load_profile("native")


def repair_of(*profiles, **wishes):
    """A repair as a stage: of the native profile, if nothing is said."""
    return Repair(profiles or [NATIVE], **wishes).stage()


def through(stage, frames):
    """The frames that leave a stage, its own among them, and its state at the end."""
    chain, states, sent = Chain([stage]), [stage.state], []
    for frame in frames:
        states = woken(chain, states, sent, frame.due_ns)
        states, some = chain.through(states, (frame,))
        sent += some
    states = woken(chain, states, sent, None)
    return sent, states[0]


def woken(chain, states, sent, until_ns):
    while (due := chain.next_wake(states)) is not None and (until_ns is None or due[0] <= until_ns):
        states, some = chain.wake(states, due[1], due[0])
        sent += some
    return states


def repaired(frames, *profiles, **wishes):
    return through(repair_of(*profiles, **wishes), frames)[0]


def told(frames, *profiles, **wishes):
    stage = repair_of(*profiles, **wishes)
    return stage.told(through(stage, frames)[1])


def later(frames, ms):
    return [replace(frame, due_ns=frame.due_ns + round(ms * 1e6)) for frame in frames]


def faster(frames, speed):
    first_ns = frames[0].due_ns
    return [replace(f, due_ns=first_ns + round((f.due_ns - first_ns) / speed)) for f in frames]


def looped(frames, passes, images):
    """The frames of `images` images, `passes` times, an image's time apart."""
    return [frame for k in range(passes) for frame in later(frames, 40 * images * k)]


def values_of(profile, frames, quantity):
    """A quantity in the frames that carry it, in order."""
    decoded = [profile.decode(frame) or {} for frame in frames]
    return [values[quantity] for values in decoded if quantity in values]
