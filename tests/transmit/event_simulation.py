"""A literal scheduler to compare with: walks every millisecond and keeps lists of what is to come."""

from dataclasses import dataclass


@dataclass
class Message:
    """What a message is told to do, in ms; 0 = not."""

    cycle: int = 0
    offset: int = 0
    fast: int = 0
    on_change: bool = False
    on_write: bool = False
    repetitions: int = 0
    gap: int = 0
    delay: int = 0


def send_times(message, images, image_ms):
    """Return the ms at which frames leave; `images`: (watched value, active) of each image in turn."""
    sent, waiting, planned = [], False, []
    seen, was_active, since = None, False, None
    for now in range(len(images) * image_ms):
        value, active = images[now // image_ms]
        if now < message.offset:
            continue
        first = seen is None
        event = message.on_change and (first or value != seen)
        event = event or (message.on_write and (first or now % image_ms == 0))
        event = event or (was_active and not active)
        seen = value
        if active and not was_active:
            since = now
        was_active = active
        if event:
            planned = [now + k * message.gap for k in range(1, message.repetitions + 1)]
            waiting = True
        elif now in planned:
            waiting = True
        if active:
            waiting = waiting or (now - since) % message.fast == 0
        elif message.cycle:
            waiting = waiting or (now - message.offset) % message.cycle == 0
        if waiting and (not sent or now - sent[-1] >= message.delay):
            sent.append(now)
            waiting = False
    return sent
