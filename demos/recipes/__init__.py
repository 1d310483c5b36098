"""Figures of the demos: pure geometry, one function a shape, in metres. A scene beside this folder imports them from
`recipes`.
"""

from .ape import ape
from .contours import gear, seahorse
from .dolphin import dolphin
from .gnome import gnome, letter_block
from .sea import leaf_sheep, sea_mushroom, stone
from .slices import bunny_slice
from .toys import beach_ball, letter, propeller, trampoline, worm
