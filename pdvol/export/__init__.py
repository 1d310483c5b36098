"""A stored run in the formats of other software. Nothing here imports a solver.

A format is one file here, or in another package, and a line in `pdvol.registry`, or an entry point of the group
`pdvol.formats`. It offers one function

    export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields) -> list[Path]

which writes these levels into the folder `out` and returns the paths it has written. `levels` hold a state each.
`fields(level)` gives what is known of the level beside its stored motion, step by step (`series.LevelFields`); the
first call may take seconds, and a format without fields does not make it.
"""
