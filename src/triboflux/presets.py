"""Suspensions of common powders, each value with its source.

Values without a published source are marked as illustrative in `SOURCES`: they make a complete
suspension to start from, and say nothing about a particular plant. Illustrative charges are such
that the scale of the electric field stays below the breakdown of air, 3 MV/m.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from triboflux.errors import require_one_of
from triboflux.suspension import Charge, Suspension

ILLUSTRATIVE = "illustrative"
"""Source of a value that nobody published for this powder."""
DEFAULT = "default of Suspension"
"""Source of a value that the preset does not set."""


class _Cited(NamedTuple):
    """A value and where it comes from."""

    value: Any
    source: str = ILLUSTRATIVE


_BED = "manjilray/Electrostatic-dev on GitHub, EXAMPLE"
_BED_ELECTRIC = f"{_BED}/constant/electrostaticProperties"
_BED_PHASES = f"{_BED}/constant/phaseProperties"
_BED_GAS = f"{_BED}/constant/thermophysicalProperties.air"
_BED_KINETIC = f"{_BED}/constant/turbulenceProperties.particles"
_GLASS = (
    "soda-lime container glass: T. P. Seward & T. Vascott (eds.), High Temperature Glass Melt "
    "Property Database for Process Modeling, American Ceramic Society (2005)"
)
_FOERSTER = (
    "3 mm soda-lime glass spheres: S. F. Foerster, M. Y. Louge, H. Chang & K. Allia, Phys. Fluids "
    "6 (1994) 1108, doi:10.1063/1.868282"
)
_PMMA = "F. Cardarelli, Materials Handbook (2018), doi:10.1007/978-3-319-38925-7"
_INHALER = "user guide of xiaoyu32/dry_powder_inhaler_model on GitHub"

_PHARMACEUTICAL = {
    "density": _Cited(1520.0, _INHALER),
    "youngs_modulus": _Cited(5e8, f"{_INHALER}, which does not say whether it is softened"),
    "poisson_ratio": _Cited(0.35, _INHALER),
    "restitution": _Cited(0.85, _INHALER),
    "granular_temperature": _Cited(1e-2),
    "domain_length": _Cited(1e-2),
}

_VALUES: dict[str, dict[str, _Cited]] = {
    "polyethylene": {
        "diameter": _Cited(3.625e-4, _BED_ELECTRIC),
        "density": _Cited(935.0, _BED_ELECTRIC),
        "youngs_modulus": _Cited(2e6, _BED_ELECTRIC),
        "softened_modulus": _Cited(True, "2 MPa is hundreds of times less than polyethylene has"),
        "poisson_ratio": _Cited(0.5, _BED_ELECTRIC),
        "restitution": _Cited(0.8, _BED_KINETIC),
        "gas_density": _Cited(1.2, _BED_GAS),
        "gas_viscosity": _Cited(1.84e-5, _BED_GAS),
        "solid_fraction": _Cited(0.5, f"{_BED}/system/setFieldsDict"),
        "maximum_packing": _Cited(0.63, _BED_ELECTRIC),
        "radial_distribution": _Cited("lun-savage"),
        "drag": _Cited("gidaspow", _BED_PHASES),
        "granular_temperature": _Cited(1e-4, f"{_BED}/0/Theta.particles, at the inlet"),
        "domain_length": _Cited(0.1, f"{_BED}/system/blockMeshDict, width of the bed"),
        "charge_scale": _Cited(
            Charge(1.4e-4, "C/m^3"), f"{_BED}/system/setFieldsDict, without its sign"
        ),
    },
    "glass-beads": {
        "diameter": _Cited(5e-4),
        "density": _Cited(2520.0, _GLASS),
        "youngs_modulus": _Cited(72e9, _GLASS),
        "poisson_ratio": _Cited(0.21, f"{_GLASS}, from the shear modulus 29.8 GPa"),
        "restitution": _Cited(0.97, _FOERSTER),
        "solid_fraction": _Cited(0.4),
        "drag": _Cited("gidaspow"),
        "granular_temperature": _Cited(1e-3),
        "domain_length": _Cited(0.1),
        "charge_scale": _Cited(Charge(2e-8, "C/m^2")),
    },
    "pmma": {
        "diameter": _Cited(5e-5, "within the 25 to 100 um of arXiv:2602.10761"),
        "density": _Cited(1190.0, _PMMA),
        "youngs_modulus": _Cited(3e9, f"{_PMMA}, rounded"),
        "poisson_ratio": _Cited(0.38),
        "restitution": _Cited(0.9),
        "solid_fraction": _Cited(1e-3),
        "drag": _Cited("schiller-naumann"),
        "granular_temperature": _Cited(1e-2),
        "domain_length": _Cited(0.04),
        "charge_scale": _Cited(Charge(1e-6, "C/m^2")),
    },
    "pharmaceutical-carrier": {
        "diameter": _Cited(7e-5, _INHALER),
        "solid_fraction": _Cited(0.01),
        "charge_scale": _Cited(Charge(1e-6, "C/m^2")),
        **_PHARMACEUTICAL,
    },
    "pharmaceutical-fine": {
        "diameter": _Cited(5e-6, _INHALER),
        "solid_fraction": _Cited(1e-3),
        "charge_scale": _Cited(Charge(5e-7, "C/m^2")),
        **_PHARMACEUTICAL,
    },
}

NAMES = tuple(_VALUES)
"""Names of the presets."""

SOURCES: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        name: MappingProxyType(
            {
                field: values[field].source if field in values else DEFAULT
                for field in Suspension.model_fields
            }
        )
        for name, values in _VALUES.items()
    }
)
"""Where each field of each preset comes from: a citation, `ILLUSTRATIVE` or `DEFAULT`."""


def fill(name: object, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a suspension, those of a preset where they are not given.

    The mark of a softened modulus goes with the preset's modulus; a charge per surface or volume
    becomes one per particle with the diameter that is given.

    Parameters
    ----------
    name : object
        One of `NAMES`.
    given : mapping
        Fields that replace those of the preset.

    Returns
    -------
    dict
        Not validated.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    require_one_of("preset", name, NAMES)
    values = {field: cited.value for field, cited in _VALUES[str(name)].items()}
    if "youngs_modulus" in given:
        values.pop("softened_modulus", None)
    return values | dict(given)


def polyethylene(**changes: Any) -> Suspension:
    """Return polyethylene granules in a fluidised bed.

    From a simulation of a charged bubbling bed, the example of the repository
    manjilray/Electrostatic-dev. Its Young's modulus of 2 MPa is softened, which lengthens the
    contacts; give ``youngs_modulus="1 GPa"`` for contacts closer to real ones. The example uses
    another radial distribution (Sinclair & Jackson).

    Parameters
    ----------
    **changes
        Fields of `Suspension` to replace.

    Returns
    -------
    Suspension
        With the source of each field in ``SOURCES["polyethylene"]``.
    """
    return Suspension(**fill("polyethylene", changes))


def glass_beads(**changes: Any) -> Suspension:
    """Return glass beads in a fluidised bed.

    Density and elastic data of soda-lime glass from Seward & Vascott (2005), restitution
    measured by Foerster et al. (1994), doi:10.1063/1.868282. Size, state and charge are
    illustrative.

    Parameters
    ----------
    **changes
        Fields of `Suspension` to replace.

    Returns
    -------
    Suspension
        With the source of each field in ``SOURCES["glass-beads"]``.
    """
    return Suspension(**fill("glass-beads", changes))


def pmma(**changes: Any) -> Suspension:
    """Return PMMA powder in a duct.

    Size as in Wilms & Grosshans (2026), arXiv:2602.10761, density and modulus from Cardarelli's
    Materials Handbook (2018), doi:10.1007/978-3-319-38925-7. Poisson's ratio, restitution, state
    and charge are illustrative.

    Parameters
    ----------
    **changes
        Fields of `Suspension` to replace.

    Returns
    -------
    Suspension
        With the source of each field in ``SOURCES["pmma"]``.
    """
    return Suspension(**fill("pmma", changes))


def pharmaceutical_carrier(**changes: Any) -> Suspension:
    """Return the carrier particles of a dry powder inhaler.

    Particles from the user guide of the repository xiaoyu32/dry_powder_inhaler_model; state and
    charge are illustrative.

    Parameters
    ----------
    **changes
        Fields of `Suspension` to replace.

    Returns
    -------
    Suspension
        With the source of each field in ``SOURCES["pharmaceutical-carrier"]``.
    """
    return Suspension(**fill("pharmaceutical-carrier", changes))


def pharmaceutical_fine(**changes: Any) -> Suspension:
    """Return the fine, active particles of a dry powder inhaler.

    Particles from the user guide of the repository xiaoyu32/dry_powder_inhaler_model; state and
    charge are illustrative.

    Parameters
    ----------
    **changes
        Fields of `Suspension` to replace.

    Returns
    -------
    Suspension
        With the source of each field in ``SOURCES["pharmaceutical-fine"]``.
    """
    return Suspension(**fill("pharmaceutical-fine", changes))


FUNCTIONS: Mapping[str, Callable[..., Suspension]] = MappingProxyType(
    {
        "polyethylene": polyethylene,
        "glass-beads": glass_beads,
        "pmma": pmma,
        "pharmaceutical-carrier": pharmaceutical_carrier,
        "pharmaceutical-fine": pharmaceutical_fine,
    }
)
"""The presets by name."""
