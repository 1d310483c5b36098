"""What Blender sees: properties, buttons, the panel, and the caches that objects follow. All of bpy is here."""
