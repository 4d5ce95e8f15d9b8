"""`node`: all other messages of the emulated control unit, sent with their start values."""

from vsensor.codec import Database
from vsensor.errors import ConfigError
from vsensor.profile.bind import hint
from vsensor.profile.config import MessageConfig, ProfileConfig


def node_messages(config: ProfileConfig, database: Database, path: str) -> dict[str, MessageConfig]:
    """Return the messages of the profile's node that it does not name and that have a cycle time.

    By id. What the database sends by events alone is left out. Raises ConfigError for an unknown node.
    """
    if config.node is None:
        return {}
    senders = {sender for layout in database.layouts.values() for sender in layout.senders}
    if config.node not in senders:
        raise ConfigError(f"{path}: node: {config.node!r} sends no message{hint(config.node, senders)}")
    others = [
        layout
        for layout in database.layouts.values()
        if config.node in layout.senders and layout.name not in config.messages and layout.cycle_ms > 0
    ]
    ordered = sorted(others, key=lambda layout: (layout.is_extended, layout.arbitration_id))
    return {layout.name: MessageConfig(cycle_ms=layout.cycle_ms) for layout in ordered}
