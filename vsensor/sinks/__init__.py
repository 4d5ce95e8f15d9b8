"""Where output goes: bus, log, trace, live table."""
