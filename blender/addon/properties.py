"""What a user sets: of each object its part in the shot, of the scene all else. Both are kept in the .blend."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from ..shot.description import PRESETS, Material
from ..shot.names import CLOSE_HOLES, WIDEST_HOLE

OWN = "OWN"
OVERRIDE = {"LIBRARY_OVERRIDABLE"}
"""Of an object's properties: a library override keeps its own."""
MATERIALS = [*((key, name, f"{m.young:g} Pa, {m.density:g} kg/m³") for key, (name, m) in PRESETS.items())]
MATERIALS.append((OWN, "Own", "The numbers below"))
ROLES = [
    ("NONE", "Nothing", "It takes no part"),
    ("BODY", "Body", "A soft body"),
    ("OBSTACLE", "Obstacle", "Bodies cannot enter it; it follows its animation"),
]


def _preset_chosen(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    if settings.preset != OWN:
        material = PRESETS[settings.preset][1]
        settings.young, settings.poisson = material.young, material.poisson
        settings.density, settings.damping = material.density, material.damping


class MaterialSettings:
    """Properties that bodies and regions share."""

    preset: EnumProperty(override=OVERRIDE, name="Material", items=MATERIALS, default="JELLY", update=_preset_chosen)
    young: FloatProperty(
        override=OVERRIDE,
        name="Young's modulus",
        description="Stiffness [Pa]",
        default=1.0e4,
        min=1.0,
        soft_max=1.0e8,
        precision=0,
    )
    poisson: FloatProperty(
        override=OVERRIDE, name="Poisson's ratio", description="0.5 keeps the volume", default=0.45, min=-0.9, max=0.495
    )
    density: FloatProperty(
        override=OVERRIDE, name="Density", description="[kg/m³]", default=1050.0, min=1.0e-3, soft_max=2.0e4
    )
    damping: FloatProperty(
        override=OVERRIDE,
        name="Damping",
        description="Stress per strain rate, divided by stress per strain [s]",
        default=0.005,
        min=0.0,
    )

    def material(self) -> Material:
        """The material."""
        numbers = self.young, self.poisson, self.density, self.damping
        return PRESETS[self.preset][1] if self.preset != OWN else Material(*(float(f"{n:.6g}") for n in numbers))


class PDVOL_RegionSettings(MaterialSettings, bpy.types.PropertyGroup):
    """A vertex group that is made of something else."""

    group: StringProperty(
        override=OVERRIDE, name="Vertex group", description="The part of the body that is made of this"
    )


class PDVOL_ObjectSettings(MaterialSettings, bpy.types.PropertyGroup):
    """An object's part in the shot."""

    role: EnumProperty(override=OVERRIDE, name="Part", items=ROLES, default="NONE")
    vertices: StringProperty(
        override=OVERRIDE,
        name="Vertices",
        description="Of each level, coarsest first: 200 600 2000",
        default="200 600 2000",
    )
    velocity: FloatVectorProperty(
        override=OVERRIDE, name="Velocity", description="At the first frame [m/s]", size=3, subtype="XYZ"
    )
    pins: StringProperty(
        override=OVERRIDE, name="Pins", description="Vertex group that is held, or led by the object's own animation"
    )
    reach: FloatProperty(
        override=OVERRIDE,
        name="Reach",
        description="How far from the vertex group vertices are held, in per cent of the object's size",
        default=5.0,
        min=0.01,
        max=100.0,
        subtype="PERCENTAGE",
    )
    regions: CollectionProperty(type=PDVOL_RegionSettings, override=OVERRIDE | {"USE_INSERTION"})
    pull: PointerProperty(
        override=OVERRIDE,
        name="Pulled by",
        description="An empty, which draws the part of the body to it that is nearest at the first frame",
        type=bpy.types.Object,
        poll=lambda settings, thing: thing.type == "EMPTY",
    )
    pull_frames: IntVectorProperty(
        override=OVERRIDE, name="In frames", description="The first and the last one; all where both are 0", size=2
    )
    repair: BoolProperty(
        override=OVERRIDE, name=CLOSE_HOLES, description="Simulate a closed copy of an open or crossing mesh"
    )
    hole: FloatProperty(
        override=OVERRIDE,
        name=WIDEST_HOLE,
        description="Longest rim of a hole that is closed, in diagonals of the object",
        default=1.0,
        min=0.0,
        soft_max=4.0,
    )


def _level_chosen(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import playback

    playback.show(context.scene)


_parameters: list = []  # Blender keeps no reference to the items of a list that changes


def _wedge_parameters(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> list:
    from .gather import parameter_labels

    _parameters[:] = [(name, label, "") for name, label in parameter_labels(context.scene).items()]
    return _parameters


def _variations(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> list:
    from . import thumbnails

    return thumbnails.items()


class PDVOL_SceneSettings(bpy.types.PropertyGroup):
    """All of a shot but its objects."""

    ground: BoolProperty(name="Ground", description="A horizontal plane that bodies cannot pass", default=True)
    height: FloatProperty(name="Height", description="Of the ground", subtype="DISTANCE")
    friction: FloatProperty(
        name="Friction", description="Coefficient, of all surfaces", default=0.3, min=0.0, soft_max=2
    )
    steps: IntProperty(
        name="Steps a frame", description="Time steps from one frame to the next", default=2, min=1, max=100
    )
    run: IntProperty(name="Run", description="The run that is shown", min=0, update=_level_chosen)
    level: IntProperty(name="Shown level", description="0 is the coarsest", min=0, update=_level_chosen)
    refine_to: IntProperty(name="To level", description="The finest level of Refine", default=1, min=1)
    varied: EnumProperty(name="Vary", items=_wedge_parameters)
    first: FloatProperty(name="From", default=0.1, precision=3)
    last: FloatProperty(name="To", default=0.9, precision=3)
    count: IntProperty(name="Variations", default=6, min=2, max=100)
    chosen: EnumProperty(name="Variation", items=_variations)


CLASSES = (PDVOL_RegionSettings, PDVOL_ObjectSettings, PDVOL_SceneSettings)


def register() -> None:
    """Objects and scenes have `.pdvol` from now on."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Object.pdvol = PointerProperty(type=PDVOL_ObjectSettings, override=OVERRIDE)
    bpy.types.Scene.pdvol = PointerProperty(type=PDVOL_SceneSettings)


def unregister() -> None:
    """They have it no more."""
    del bpy.types.Scene.pdvol, bpy.types.Object.pdvol
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
