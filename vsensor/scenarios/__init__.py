"""Scenarios, maps and the default error model shipped with the package (data only)."""
