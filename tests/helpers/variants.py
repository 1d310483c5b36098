"""Runs of two levels by each method, integrator and kind of scene, each made once in a session."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

from cli_scenes import FALL, SQUARE, pdvol, write

STEPS = 8
BENT = (
    SQUARE
    + f"""

def scene(turn=1.0, mirror=1.0, hold=0.05, steps={STEPS}):
    def bent(X):
        \"\"\"A part of a ring, open upward.\"\"\"
        radius, angle = 1.0 / turn + 0.5 - X[:, 1], turn * (X[:, 0] - 0.5)
        return np.column_stack([mirror * radius * np.sin(angle), 1.0 / turn - radius * np.cos(angle)])

    bodies = (Body((square(3), square(6)), NeoHookean(2e4), name="clip", start=bent),
              Body((square(2), square(4)), NeoHookean(2e4), name="box", placement=Placement(translate=(-0.5, 0.65))))
    return Scene(bodies, dt=0.02, steps=steps, loads=(pdvol.Gravity((0.0, -9.81)),), contact=(Barrier(), Friction(0.3)),
                 supports=(Support(lambda X: X[:, 0] < 1e-9, body="clip", release=hold),),
                 obstacles=(Plane((0.0, -0.7), (0.0, 1.0)),))
"""
)
"""Bodies that start away from rest."""
TERMS = """
from pdvol import Attachment, Barrier, Body, Flow, Friction, Gravity, Keyed, Muscle, NeoHookean, Placement, Plane, Scene
from pdvol import Support, meshes

def scene(steps=12):
    soft = NeoHookean(Keyed((0.0, 0.1), (1e5, 9e4)), 0.3, 1000.0)
    held = Body(meshes.rectangle(0.4, 0.1), soft, (30, 90), name="held", placement=Placement(translate=(0.0, 0.154)))
    hung = Body(meshes.rectangle(0.4, 0.2), soft, (30, 90), name="hung", velocity=lambda X: -2.0 * X[:, :1] * (0, 1),
                start=lambda X: X * (1.01, 1.0))
    glue = Attachment("hung", "held", lambda X: X[:, 1] > 0.099, stiffness=5e5, breaking=900.0)
    keyed = lambda first, last: Keyed((0.0, 0.1), (first, last))
    return Scene((held, hung), dt=0.01, steps=steps, contact=(Barrier(), Friction(0.2)), attachments=(glue,),
                 loads=(Gravity(keyed((0.0, -9.81), (5.0, -9.81))), Flow(keyed((0.0, 0.0), (3.0, 0.0)))),
                 muscles=(Muscle("held", (1.0, 0.0), 2e4, keyed(0.0, 1.0)),),
                 supports=(Support(lambda X: X[:, 1] > 0.2, body="held"),),
                 obstacles=(Plane((0.0, -0.11), (0.0, 1.0)),))
"""
"""Loads, a material and a muscle by keyframes, an attachment that breaks, and a body that starts stretched."""
STRICT = ("--set", "tolerance=1e-4", "--steps", STEPS)  # [m/s]: what is solved leaves little in the balance
VARIANTS: dict[str, tuple] = {
    "progressive": (FALL, "--set", "feedback=0", *STRICT),
    "direct": (FALL, "--method", "direct", *STRICT),
    "direct_euler": (FALL, "--method", "direct", "--set", "integrator=implicit_euler", *STRICT),
    "consistency": (FALL, "--set", "consistency=0.2", "--set", "feedback=0", *STRICT),
    "feedback": (FALL, "--set", "feedback=0.2", *STRICT),
    "both_euler": (
        *(FALL, "--set", "consistency=0.2", "--set", "feedback=0.2", "--set", "integrator=implicit_euler", *STRICT),
    ),
    "tracks": (FALL, "--method", "tracks", "--set", "weight=0.2", *STRICT),
    "embedded": (FALL, "--method", "embedded", "--prolongation", "phong", *STRICT),
    "biharmonic": (FALL, "--prolongation", "biharmonic", *STRICT),
    "bent": (BENT,),
    "terms": (TERMS,),
}
"""The scene file and the options of each."""
FALLING = [name for name, (scene, *_) in VARIANTS.items() if scene is FALL]


def runs_in(folder: Path) -> Callable[[str], Path]:
    """A function that gives the run of a variant, in this folder and made at the first call."""

    @cache
    def made(name: str) -> Path:
        assert run(name, folder / name) == 0
        return folder / name

    def run(name: str, out: Path, *more, command: str = "run") -> int:
        """The exit code of a command that writes the variant's run into `out`, or goes on with it."""
        text, *words = VARIANTS[name]
        scene = folder / f"{('fall', 'bent', 'terms')[(FALL, BENT, TERMS).index(text)]}.py"
        if not scene.exists():
            write(scene, text)
        return pdvol(command, scene, "--out", out, "--no-picture", "--no-xdmf", *words, *more)

    made.run = run
    return made
