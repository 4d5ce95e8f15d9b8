"""A virtual lane-detection sensor: a road scene in, DBC-defined lane frames on CAN out."""
