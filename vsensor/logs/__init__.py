"""Reading, writing and bulk decoding of CAN log files."""
