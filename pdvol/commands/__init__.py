"""One file a verb of the command line: `add_arguments(parser)` and `main(options) -> int | None`, its exit code.

`pdvol.registry.COMMANDS` lists the verbs. A verb imports what it uses inside `main`, so that help and refused arguments
load no numerical library. Errors of `pdvol.errors` become one line and an exit code in `pdvol.cli`.
"""
