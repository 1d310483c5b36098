"""`python -m pdvol`: the same as the command `pdvol`."""

from pdvol.cli import main

main()
