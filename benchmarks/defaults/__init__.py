"""Which defaults give the smaller error at equal CPU time."""
