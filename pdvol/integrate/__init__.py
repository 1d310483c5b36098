"""Time stepping: one step of one level with its recovery, scripted motions, and the marches over a shot."""
