"""Materials: one UFL function in forms/ and one dataclass each."""

from dataclasses import dataclass

from pdvol.errors import InputError
from pdvol.forms import elasticity
from pdvol.scene.checks import finite, positive, require


@dataclass(frozen=True)
class Material:
    """Isotropic hyperelastic material; a law overrides `psi`.

    Attributes
    ----------
    young : float [Pa], poisson : float, density : float [kg/m^3] ([kg/m^2] per metre of depth in 2D, which is plane strain)
    """

    young: float
    poisson: float = 0.4
    density: float = 1000.0

    def __post_init__(self):
        name = type(self).__name__
        positive(f"{name}.young", self.young)
        positive(f"{name}.density", self.density)
        finite(f"{name}.poisson", self.poisson)
        require(-1.0 < self.poisson < 0.5, f"{name}.poisson = {self.poisson!r} must lie between -1 and 0.5 (0.499 is the stiffest in use)")

    @property
    def mu(self) -> float:
        """Shear modulus [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def lmbda(self) -> float:
        """First Lame parameter [Pa]."""
        return self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))

    @staticmethod
    def psi(F, mu, lmbda):
        """Energy density [Pa] of the deformation gradient F, as UFL."""
        raise InputError("a material must define psi(F, mu, lmbda); use NeoHookean or your own subclass of Material")


@dataclass(frozen=True)
class NeoHookean(Material):
    """Compressible Neo-Hookean law with a logarithmic volume term: infinite energy at zero volume."""

    psi = staticmethod(elasticity.neo_hookean)
