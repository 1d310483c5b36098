from . import forms as forms
from . import meshes as meshes
from .cli import (
    main as main,
)
from .studio.draw.image import (
    picture as picture,
)
from .errors import (
    ConvergenceError as ConvergenceError,
    InputError as InputError,
    IntersectionError as IntersectionError,
    InvertedCellError as InvertedCellError,
    MeshError as MeshError,
    PdvolError as PdvolError,
    SimulationError as SimulationError,
)
from .studio.wedge.api import (
    wedge as wedge,
)
from .meshes import (
    Outline as Outline,
    RenderSurface as RenderSurface,
    Solid as Solid,
    Surface as Surface,
)
from .meshing.point_caches import (
    cached_surface as cached_surface,
)
from .runs.api import (
    run as run,
)
from .runs.own_energy import (
    Contact as Contact,
)
from .scene import (
    Attachment as Attachment,
    Barrier as Barrier,
    Body as Body,
    Deforming as Deforming,
    FixedCorotational as FixedCorotational,
    Flow as Flow,
    Force as Force,
    Friction as Friction,
    Gravity as Gravity,
    Impulse as Impulse,
    Keyed as Keyed,
    Material as Material,
    Muscle as Muscle,
    NeoHookean as NeoHookean,
    Path as Path,
    Penalty as Penalty,
    Placement as Placement,
    Plane as Plane,
    PointCache as PointCache,
    PointForce as PointForce,
    Posed as Posed,
    Pressure as Pressure,
    Region as Region,
    Relative as Relative,
    RenderMesh as RenderMesh,
    Rigid as Rigid,
    Rotation as Rotation,
    Scene as Scene,
    Separate as Separate,
    Sequential as Sequential,
    Solver as Solver,
    StVenantKirchhoff as StVenantKirchhoff,
    Still as Still,
    Support as Support,
    TakeOver as TakeOver,
    Translation as Translation,
)
from .store.reader import (
    open_run as open_run,
)

__version__: str
