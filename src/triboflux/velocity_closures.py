"""How collisions and flight change the moments of the velocities alone, exactly.

The models that hold the granular temperature need none of this. One that lets R_ij = ⟨c'_i c'_j⟩
and Θ = R_mm/3 change needs the answers of the collision integral C(ψ) of
`triboflux.collision.collide` to them, and a closure for S_ijk = ⟨c'_i c'_j c'_k⟩. With the mean
velocity held at zero, uniform n, and restitution e,

    ∂R_ij/∂t = −∂_k S_ijk − 2 R_ij/τ_p − (cooling Θ δ_ij + isotropy R'_ij)/τ_c + transfer,
    ∂S_ijk/∂t = P_ijk − 3 S_ijk/τ_p − [a1 S_ijk + a2 (S_imm δ_jk + S_jmm δ_ik + S_kmm δ_ij)]/τ_c,

where R' = R − Θ δ, 1/τ_c = 4√π n g0 d² √Θ follows the local Θ, and answers are linear in R' and S.

*Relaxation.* With f = Maxwellian (1 + R'_ij c_i c_j/(2Θ²) + S_ijk H_ijk/(6Θ³)), where H_ijk =
c_i c_j c_k − Θ (c_i δ_jk + c_j δ_ik + c_k δ_ij), so that S brings no mean velocity with it,

    cooling = (1 − e²)/3,             isotropy = (1+e)(3−e)/5,
    a1 = 3 (1+e)(3−e)/10,             a2 = −(1+e)(1+3e)/60.

R' does not change the cooling at first order. The part of S without traces decays with a1, 3/2 of
the rate of R'; its traces S_imm decay with a1 + 5 a2 = (1+e)(49−33e)/60, 8/15 at e = 1.

*Transfer over a diameter.* The partner is at x + d k. What C(c_i c_j) answers to the second
derivatives of its R is, with w = (1+e)(1+3e)/420 and in units of d²/τ_c,

    w [∇²R_ij + 2 (∂_i∂_k R_jk + ∂_j∂_k R_ik) + δ_ij ∂_k∂_l R_kl + ∂_i∂_j R_mm + δ_ij ∇²R_mm/2],

for R = Θδ  b1 ∇²Θ δ_ij + b2 ∂_i∂_jΘ  with  b1 = (1+e)(1+3e)/120 and b2 = 2 b1. A third of its trace
is (1+e)(1+3e)/72 ∇²Θ. Of that (1+e)/18 is the divergence of a flux, at e = 1 the collisional
conductivity of dense gases; the rest, −(1−e²)/24, is that a pair loses energy by both its
temperatures. First derivatives of R change odd moments only, those of S even ones. In units of
√π d/(√Θ τ_c), at R = Θδ,

    C(c_i c_j) = −f [∂_l S_lij + (δ_ij ∂_l S_lmm + ∂_i S_jmm + ∂_j S_imm)/2],  f = (1+e)²/140,
    C(c_i) = −(1+e)/60 (2 ∂_l R_il + ∂_i R_mm),  and in P_ijk, with p = (1+e)²(2e−1)/140,
    −p Θ [∂_i R_jk + ∂_l R_il δ_jk + ∂_i R_mm δ_jk/2 + the same with i and j, i and k exchanged].

These are no smaller than the transfer above: Θ's dispersion is that of flight times
(1 + 12 α g0/5)² at e = 1, α being the solid fraction, plus d²/(9 τ_c).

*Production.* Flight of a Gaussian of variances R gives −∂_l(R_ij R_kl + R_ik R_jl + R_il R_jk). The
force that holds the mean velocity is a_i = ∂_l R_il − C(c_i), and a_i R_jk and its like cancel
those terms in which R_il itself is differentiated, and C(c_i) R_jk, which p has less already:

    P_ijk = −(R_il ∂_l R_jk + R_jl ∂_l R_ik + R_kl ∂_l R_ij) + the terms with p.

*Closure.* ∂S/∂t = 0 with A = a1/τ_c + 3/τ_p and B = a2/τ_c gives S_imm = P_imm/(A + 5B), then
S_ijk = [P_ijk − B (S_imm δ_jk + S_jmm δ_ik + S_kmm δ_ij)]/A; `third_moment` is that, and
`flight_dispersion` what it makes of −∂_k S_ijk and of the terms with f, around R = Θδ.

`benchmarks.velocity_algebra` derives all of it by computer algebra. Everything here is arithmetic
only, so that floats, NumPy and JAX arrays and symbols pass through.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class TensorDispersion(NamedTuple):
    """Factors of the five isotropic operators of second order on a symmetric tensor R_ij.

    Attributes
    ----------
    laplacian : scalar or array_like
        Of ∇²R_ij.
    gradient_divergence : scalar or array_like
        Of ∂_i∂_k R_jk + ∂_j∂_k R_ik.
    double_divergence : scalar or array_like
        Of δ_ij ∂_k∂_l R_kl.
    trace_hessian : scalar or array_like
        Of ∂_i∂_j R_mm.
    trace_laplacian : scalar or array_like
        Of δ_ij ∇²R_mm.
    """

    laplacian: Any
    gradient_divergence: Any
    double_divergence: Any
    trace_hessian: Any
    trace_laplacian: Any

    def times(self, factor: Any) -> TensorDispersion:
        """Return all factors times a number, for instance d²/τ_c."""
        return TensorDispersion(*(factor * own for own in self))

    def plus(self, other: TensorDispersion) -> TensorDispersion:
        """Return the operator that does what both do."""
        return TensorDispersion(*(mine + its for mine, its in zip(self, other, strict=True)))

    def of_temperature(self) -> tuple[Any, Any]:
        """Return b1 and b2 of what R = Θδ gives, b1 ∇²Θ δ_ij + b2 ∂_i∂_jΘ."""
        return (
            self.laplacian + self.double_divergence + 3 * self.trace_laplacian,
            2 * self.gradient_divergence + 3 * self.trace_hessian,
        )

    def conductivity(self) -> Any:
        """Return κ of ∂Θ/∂t = κ ∇²Θ for R = Θδ, b1 + b2/3."""
        isotropic, hessian = self.of_temperature()
        return isotropic + hessian / 3

    def along_axis(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """Return what ∂²R_xx/∂x² and ∂²R_mm/∂x² give R_xx, then R_mm, if all depends on x only."""
        a, b, c, d, e = self
        return (a + 2 * b + c, d + e), (2 * b + 3 * c, a + d + 3 * e)


class VelocityClosures(NamedTuple):
    """Collision coefficients of R_ij and S_ijk; the module tells the equations they are in.

    Attributes
    ----------
    cooling : scalar or array_like
        Decay of Θ, times 1/τ_c.
    isotropy : scalar or array_like
        Decay of R' = R − Θδ, times 1/τ_c.
    third_moment, third_moment_trace : scalar or array_like
        a1 and a2, the relaxation of S_ijk and the part by its traces, times 1/τ_c.
    transfer : TensorDispersion
        What C(c_i c_j) answers to second derivatives of R, times d²/τ_c.
    transfer_flux, transfer_loss : scalar or array_like
        The parts of the transfer's conductivity that are the divergence of a flux and a loss of
        energy, times d²/τ_c.
    flux_shift, production_shift : scalar or array_like
        f and p, what collisions add to the flux of R by S and to the production of S, times
        √π d/(√Θ τ_c), which is 24 α g0.
    momentum_shift : scalar or array_like
        That of C(c_i), −(2 ∂_l R_il + ∂_i R_mm) times this, with the same units.
    """

    cooling: Any
    isotropy: Any
    third_moment: Any
    third_moment_trace: Any
    transfer: TensorDispersion
    transfer_flux: Any
    transfer_loss: Any
    flux_shift: Any
    production_shift: Any
    momentum_shift: Any


def velocity_closures(restitution: Any) -> VelocityClosures:
    """Return the exact collision coefficients of the moments of velocity.

    Parameters
    ----------
    restitution : scalar or array_like
        e, dimensionless, from 0 to 1.
    """
    e = restitution
    stress = (1 + e) * (3 - e)
    steep = (1 + e) * (1 + 3 * e)
    return VelocityClosures(
        cooling=(1 - e**2) / 3,
        isotropy=stress / 5,
        third_moment=3 * stress / 10,
        third_moment_trace=-steep / 60,
        transfer=TensorDispersion(2, 4, 2, 2, 1).times(steep / 840),
        transfer_flux=(1 + e) / 18,
        transfer_loss=-(1 - e**2) / 24,
        flux_shift=(1 + e) ** 2 / 140,
        production_shift=(1 + e) ** 2 * (2 * e - 1) / 140,
        momentum_shift=(1 + e) / 60,
    )


class FlowClosures(NamedTuple):
    """What collisions over a diameter make of a mean velocity; `triboflux.models.flow` tells where.

    Attributes
    ----------
    pressure : scalar or array_like
        Of 2 R_xx + R_mm in the flux of momentum, times √π d/(√Θ τ_c).
    viscosity : scalar or array_like
        Of ∂U/∂x there, times d²/τ_c.
    work_along, work_across : scalar or array_like
        Of g R_xx and g R_tt in the equation of R_xx, times √π d/(√Θ τ_c).
    work : scalar or array_like
        Of g (3 R_xx + 2 R_tt) in that of R_mm, with the same units.
    heating_along, heating : scalar or array_like
        Of g² in the equations of R_xx and R_mm, times d²/τ_c.
    lost_work, lost_heating : scalar or array_like
        What of both is lost per mass, that is neither kinetic energy of the mean nor ½ R_mm.
    """

    pressure: Any
    viscosity: Any
    work_along: Any
    work_across: Any
    work: Any
    heating_along: Any
    heating: Any
    lost_work: Any
    lost_heating: Any


def flow_closures(restitution: Any) -> FlowClosures:
    """Return the exact collision coefficients of a mean velocity that changes along x.

    Parameters
    ----------
    restitution : scalar or array_like
        e, dimensionless, from 0 to 1.
    """
    e = restitution
    steep = (1 + e) * (1 + 3 * e)
    return FlowClosures(
        pressure=velocity_closures(e).momentum_shift,
        viscosity=(1 + e) / 10,
        work_along=(1 + e) / 5 - 3 * (1 + e) ** 2 / 28,
        work_across=-3 * (1 + e) ** 2 / 70,
        work=(1 + e) * (1 - 3 * e) / 60,
        heating_along=steep / 28,
        heating=steep / 20,
        lost_work=-(1 - e**2) / 40,
        lost_heating=3 * (1 - e**2) / 40,
    )


def third_moment(
    production: Any,
    production_traces: Any,
    closures: VelocityClosures,
    *,
    collision_rate: Any,
    drag_rate: Any = 0,
) -> Any:
    """Return the components of S whose production and destruction are in balance.

    Parameters
    ----------
    production : scalar or array_like
        P_ijk, one component or many.
    production_traces : scalar or array_like
        P_imm δ_jk + P_jmm δ_ik + P_kmm δ_ij for the same i, j, k.
    closures : VelocityClosures
        From `velocity_closures`.
    collision_rate, drag_rate : scalar or array_like
        1/τ_c and 1/τ_p.
    """
    whole, part = _relaxation(closures, collision_rate, drag_rate)
    return (production - part * production_traces) / whole


def flight_dispersion(
    closures: VelocityClosures,
    *,
    temperature: Any,
    collision_rate: Any,
    drag_rate: Any = 0,
    density_number: Any = 0,
) -> TensorDispersion:
    """Return what S in balance does to R = Θδ + small, −∂_k S_ijk and the terms with f.

    Parameters
    ----------
    closures : VelocityClosures
        From `velocity_closures`.
    temperature : scalar or array_like
        Θ.
    collision_rate, drag_rate : scalar or array_like
        1/τ_c and 1/τ_p.
    density_number : scalar or array_like
        √π d/(√Θ τ_c), that is 24 α g0; 0 leaves out that collisions act over a diameter.

    Notes
    -----
    Without it the factors are Θ/A times 1, 1 − 2r, −2r, −2r and −r with r = B/(A + 5B). They
    disperse every wave of every R if A and A + 5B are positive, as −∂_k S_ijk is then minus a
    positive quadratic form of the symmetric gradient of R.
    """
    whole, part = _relaxation(closures, collision_rate, drag_rate)
    beyond = density_number * closures.flux_shift
    more = density_number * closures.production_shift
    flux = 1 + beyond
    # S = −(Θ/A) [gradient (∂_i R_jk + ...) + divergence (∂_l R_il δ_jk + ...)
    #             + trace (∂_i R_mm δ_jk + ...)]
    gradient = 1 + more
    divergence = more - part * (2 * gradient + 5 * more)
    trace = more / 2 - part * (gradient + 5 * more / 2)
    # S_imm = −(Θ/A) [by_divergence ∂_l R_il + by_trace ∂_i R_mm]
    by_divergence = 2 * gradient + 5 * divergence
    by_trace = gradient + 5 * trace
    return TensorDispersion(
        laplacian=flux * gradient,
        gradient_divergence=flux * (gradient + divergence) + beyond * by_divergence / 2,
        double_divergence=flux * divergence + beyond * by_divergence / 2,
        trace_hessian=2 * flux * trace + beyond * by_trace,
        trace_laplacian=flux * trace + beyond * by_trace / 2,
    ).times(temperature / whole)


def _relaxation(closures: VelocityClosures, collision_rate: Any, drag_rate: Any) -> tuple[Any, Any]:
    """Return A, and r = B/(A + 5B)."""
    whole = closures.third_moment * collision_rate + 3 * drag_rate
    traces = closures.third_moment_trace * collision_rate
    return whole, traces / (whole + 5 * traces)
