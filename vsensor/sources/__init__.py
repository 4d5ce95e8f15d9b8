"""Where snapshots come from: a drive over a map, a recorded drive."""
