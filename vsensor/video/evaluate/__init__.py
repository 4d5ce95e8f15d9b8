"""A video's offsets against those on the CAN bus, and the truth where there is one (P2 2.3 to 2.6)."""
