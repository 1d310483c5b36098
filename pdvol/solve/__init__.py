"""Newton's method on an incremental potential."""
