"""Which settings give an accuracy in the shortest time? `pdvol study` on eight scenes."""
