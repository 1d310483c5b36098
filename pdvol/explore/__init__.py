"""Many runs of one scene: studies of speed against accuracy."""
