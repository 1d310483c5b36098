from . import forms as forms
from . import meshes as meshes
from .cli import (
    main as main,
)
from .studio.draw.picture import (
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
from .integrate.integrator import (
    Integrator as Integrator,
    State as State,
)
from .integrate.stepper import (
    Stepper as Stepper,
)
from .levels.model import (
    LevelModel as LevelModel,
)
from .levels.space import (
    LevelSpace as LevelSpace,
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
from .meshing.vertex_groups import (
    VertexGroup as VertexGroup,
)
from .potentials.assembly.hessian_blocks import (
    HessianBlocks as HessianBlocks,
)
from .potentials.potential import (
    Positions as Positions,
    Term as Term,
)
from .runs.api import (
    run as run,
)
from .runs.march import (
    March as March,
    Step as Step,
    march as march,
)
from .runs.own_energy import (
    Contact as Contact,
)
from .scene.attachments import (
    Attachment as Attachment,
    Pull as Pull,
)
from .scene.bodies import (
    Body as Body,
    Separate as Separate,
)
from .scene.contact import (
    Barrier as Barrier,
    Friction as Friction,
    Pascal as Pascal,
)
from .scene.loads import (
    Flow as Flow,
    Force as Force,
    Gravity as Gravity,
    Impulse as Impulse,
    PointForce as PointForce,
    Pressure as Pressure,
)
from .scene.materials import (
    FixedCorotational as FixedCorotational,
    Material as Material,
    NeoHookean as NeoHookean,
    Region as Region,
    StVenantKirchhoff as StVenantKirchhoff,
)
from .scene.motions import (
    Path as Path,
    Rotation as Rotation,
    Sequential as Sequential,
    Still as Still,
    Translation as Translation,
)
from .scene.muscles import (
    Muscle as Muscle,
)
from .scene.placement import (
    Placement as Placement,
)
from .scene.point_caches import (
    PointCache as PointCache,
    Posed as Posed,
    TakeOver as TakeOver,
)
from .scene.render_mesh import (
    RenderMesh as RenderMesh,
)
from .scene.scene import (
    Scene as Scene,
)
from .scene.solver import (
    Penalty as Penalty,
    Solver as Solver,
)
from .scene.surroundings import (
    Deforming as Deforming,
    Plane as Plane,
    Rigid as Rigid,
    Support as Support,
)
from .scene.values import (
    Keyed as Keyed,
    Relative as Relative,
)
from .store.reader import (
    open_run as open_run,
)

__version__: str
