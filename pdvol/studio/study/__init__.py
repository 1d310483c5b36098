"""Studies of speed against accuracy: `pdvol study`, and settings chosen from one. See docs/study.md."""
