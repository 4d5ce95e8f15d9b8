"""Learning from recorded drives: logs scanned into tables of errors, and what is made of them."""
