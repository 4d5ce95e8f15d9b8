"""Which messages are due in a slot."""

from vsensor.profile import MessagePlan
from vsensor.types import Tick


def is_due(plan: MessagePlan, slot: Tick) -> bool:
    """Return whether the message has a send time within (slot before, this slot], counted from t = 0."""
    elapsed_ns = slot.index * slot.period_ns - plan.sending.offset_ns
    if elapsed_ns < 0:
        return False
    before_ns = elapsed_ns - slot.period_ns
    return before_ns < 0 or elapsed_ns // plan.cycle_ns != before_ns // plan.cycle_ns
