"""What people look at: the terminal monitor of a bus, the examiner of a recorded drive."""
