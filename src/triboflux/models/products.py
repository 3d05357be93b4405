"""The pointwise products that the equations of several models share."""

from __future__ import annotations

from jaxtyping import Array, Float

from triboflux.models import terms as t


def symmetric(left: Float[Array, "d *x"], right: Float[Array, "d *x"]) -> Float[Array, "d d *x"]:
    """Return a_i b_j + a_j b_i."""
    product = left[:, None] * right[None]
    return product + product.swapaxes(0, 1)


VARIANCE_TIMES_FIELD = t.Product("V E", ("variance", t.FIELD), lambda v, e: v[None] * e)
FLUX_ALONG_GRADIENT = t.Product("C·∇Q", ("covariance", t.CHARGE_GRADIENT), t.dot)
FLUX_ALONG_FIELD = t.Product("C·E", ("covariance", t.FIELD), t.dot)
FIELD_SQUARED = t.Product("|E|²", (t.FIELD,), lambda e: t.dot(e, e))
GRADIENT_SQUARED = t.Product("|∇Q|²", (t.CHARGE_GRADIENT,), lambda g: t.dot(g, g))
COVARIANCE_SQUARED = t.Product("|C|²", ("covariance",), lambda c: t.dot(c, c))
FIELD_ALONG_GRADIENT = t.Product("E·∇Q", (t.FIELD, t.CHARGE_GRADIENT), t.dot)
_GRADIENT_AND_FIELD = (t.VARIANCE_GRADIENT, t.FIELD)
GRADIENT_BY_FIELD = t.Product("∇V E + E ∇V", _GRADIENT_AND_FIELD, symmetric)
GRADIENT_ALONG_FIELD = t.Product("2 E·∇V", _GRADIENT_AND_FIELD, lambda g, e: 2.0 * t.dot(g, e))
