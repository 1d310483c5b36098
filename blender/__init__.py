"""pdvol's Blender extension: soft bodies that are previewed in seconds, and refined to the same animation.

    shot/   what is to be simulated, as plain data, and the scene file that says it
    work/   pdvol as a process of its own: its command lines, its progress, what it leaves for Blender
    addon/  what Blender sees: properties, buttons, the panel

`shot` and `work` import no bpy. Nothing here imports pdvol: it runs apart from Blender, and is reached by files.
"""


def register() -> None:
    """Called by Blender when the extension is switched on."""
    from .addon import registration

    registration.register()


def unregister() -> None:
    """Called by Blender when it is switched off; ends what still runs."""
    from .addon import registration

    registration.unregister()
