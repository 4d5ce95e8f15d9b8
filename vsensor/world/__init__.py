"""Roads, routes and ground truth."""
