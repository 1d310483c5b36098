"""What snapping does to coarse cells, and how local biharmonic weights are."""
