"""Radial distribution functions at contact, g0: how much more often packed spheres collide.

The functions do arithmetic only, so that floats, arrays and symbols all pass through them; none of
them checks its fraction, `check_fraction` does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from triboflux.errors import InputError, require_one_of

CLOSEST_PACKING = 0.7405
"""Solid fraction of equal spheres in the densest arrangement there is, rounded up."""


def carnahan_starling(solid_fraction: Any, maximum_packing: Any = None) -> Any:
    """Return g0 of Carnahan & Starling (1969), which is finite at every packing below 1.

    Parameters
    ----------
    solid_fraction : float
        α, dimensionless.
    maximum_packing : float
        Not used by this law.

    Returns
    -------
    float
        Dimensionless.
    """
    return (1.0 - 0.5 * solid_fraction) / (1.0 - solid_fraction) ** 3


def lun_savage(solid_fraction: Any, maximum_packing: Any) -> Any:
    """Return g0 of Lun & Savage (1986), which diverges at the maximum packing.

    Parameters
    ----------
    solid_fraction : float
        α, dimensionless.
    maximum_packing : float
        α_m, dimensionless.

    Returns
    -------
    float
        Dimensionless.
    """
    return (1.0 - solid_fraction / maximum_packing) ** (-2.5 * maximum_packing)


def ma_ahmadi(solid_fraction: Any, maximum_packing: Any) -> Any:
    """Return g0 of Ma & Ahmadi (1986), which diverges at the maximum packing.

    Parameters
    ----------
    solid_fraction : float
        α, dimensionless.
    maximum_packing : float
        α_m, dimensionless.

    Returns
    -------
    float
        Dimensionless.
    """
    series = 1.0 + 2.5 * solid_fraction + 4.5904 * solid_fraction**2 + 4.515439 * solid_fraction**3
    return series / (1.0 - (solid_fraction / maximum_packing) ** 3) ** 0.678021


def unity(solid_fraction: Any, maximum_packing: Any = None) -> Any:
    """Return 1, the dilute limit of Boltzmann's equation.

    Parameters
    ----------
    solid_fraction : float
        Not used by this law.
    maximum_packing : float
        Not used by this law.

    Returns
    -------
    float
        Dimensionless.
    """
    return 1.0


class RadialDistribution(NamedTuple):
    """One law for g0.

    Attributes
    ----------
    name : str
        As in `LAWS`.
    function : callable
        Of solid fraction and maximum packing, arithmetic only.
    maximum_packing : float
        Default of α_m, dimensionless. Laws without it take random close packing, where spheres
        stop to flow.
    diverges : bool
        Whether g0 tends to infinity at the maximum packing.
    source : str
        Where it was published.
    validity : str
        For which fractions it holds.
    """

    name: str
    function: Callable[..., Any]
    maximum_packing: float
    diverges: bool
    source: str
    validity: str


LAWS: Mapping[str, RadialDistribution] = MappingProxyType(
    {
        law.name: law
        for law in (
            RadialDistribution(
                "carnahan-starling",
                carnahan_starling,
                0.64,
                False,
                "N. F. Carnahan & K. E. Starling, J. Chem. Phys. 51 (1969) 635, "
                "doi:10.1063/1.1672048",
                "fluid of hard spheres up to a solid fraction of about 0.5",
            ),
            RadialDistribution(
                "lun-savage",
                lun_savage,
                0.64,
                True,
                "C. K. K. Lun & S. B. Savage, Acta Mech. 63 (1986) 15, doi:10.1007/BF01182538",
                "up to the maximum packing",
            ),
            RadialDistribution(
                "ma-ahmadi",
                ma_ahmadi,
                0.64356,
                True,
                "D. Ma & G. Ahmadi, J. Chem. Phys. 84 (1986) 3449, doi:10.1063/1.450229",
                "up to the maximum packing",
            ),
            RadialDistribution(
                "unity",
                unity,
                0.64,
                False,
                "Boltzmann's equation: partners of a collision are not correlated",
                "dilute suspensions: at a solid fraction of 0.04 g0 is already 1.1",
            ),
        )
    }
)
"""The laws by name."""

NAMES = tuple(LAWS)
"""Names of the laws."""


def radial_distribution(
    name: str, solid_fraction: float, maximum_packing: float | None = None
) -> float:
    """Return g0 at contact by a law's name, its fraction checked.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    solid_fraction : float
        α, dimensionless.
    maximum_packing : float, optional
        α_m, dimensionless; by default the law's own.

    Returns
    -------
    float
        Dimensionless.

    Raises
    ------
    InputError
        If there is no such law, or the fraction does not lie between 0 and the maximum packing.
    """
    require_one_of("radial_distribution", name, NAMES)
    law = LAWS[name]
    packing = law.maximum_packing if maximum_packing is None else maximum_packing
    check_fraction(solid_fraction, packing)
    return float(law.function(solid_fraction, packing))


def check_fraction(solid_fraction: float, maximum_packing: float) -> None:
    """Refuse a solid fraction that spheres can't have.

    Parameters
    ----------
    solid_fraction : float
        α, dimensionless.
    maximum_packing : float
        α_m, dimensionless.

    Raises
    ------
    InputError
        Naming ``maximum_packing`` or ``solid_fraction``.
    """
    if not 0.0 < maximum_packing <= CLOSEST_PACKING:
        raise InputError.about(
            "maximum_packing",
            f"is {maximum_packing!r}, but must be above 0 and at most {CLOSEST_PACKING}, "
            "the closest packing of equal spheres",
        )
    if not 0.0 < solid_fraction < maximum_packing:
        raise InputError.about(
            "solid_fraction",
            f"is {solid_fraction!r}, but must be above 0 and below the maximum packing, "
            f"{maximum_packing!r}",
        )
