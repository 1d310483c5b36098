"""A stored run in the formats of other software. No format imports a solver.

A format is one file here, or in another package, and a line in `pdvol.registry`, or an entry point of the group
`pdvol.formats`. It offers one function

    export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields) -> list[Path]

which writes these levels into the folder `out` and returns the paths it has written. `levels` hold a state each.
`fields(level)` gives more fields of the level, step by step (`series.LevelFields`). Its first call may take seconds; a
format without fields does not call it.

A format whose function has a parameter `fps: float | None` takes `--fps` (frames a second; None where the user chooses
none). One that has a parameter `with_fields: bool` writes fields only with `--fields`. One that has a parameter
`surface: str`, "render" by default, takes `--surface` (`registry.SHOWN_SURFACES`). Other formats refuse these options.
"""
