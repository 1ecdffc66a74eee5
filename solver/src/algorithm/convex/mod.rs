//! The inner problem, thesis (1.18)–(1.21): for a frozen friction bound τ, minimise the convex
//!
//!   J(v) = ½ vᵀŜv − f̂ᵀv + Σ_g w_g τ_g ψ_ε(u_t(g) − d)     subject to u_n ≤ gap
//!
//! First a primal–dual active set with semi-smooth Newton steps is tried, which mostly needs one to five steps; if it
//! does not converge, projected Newton with a line search. The number of steps shows which method was needed; it is
//! reported with the residual.

mod active_set;
mod projected_newton;
mod step;

pub(super) use active_set::update_active;
pub(super) use projected_newton::least_along;
pub use step::Minimum;
pub(super) use step::close;

use crate::algorithm::factors::Factors;
use crate::algorithm::system::{State, System};
use crate::observer::Observer;

/// Minimises J from `start` until the KKT residual is below `tolerance`, and somewhat further if that is cheap. The
/// observer is called at every Newton step, and during long steps, and may stop the iterations.
pub fn minimise(
    system: &System<'_>,
    bound: &[f64],
    start: &State,
    tolerance: f64,
    observer: &mut dyn Observer,
) -> Minimum {
    minimise_with(
        system,
        bound,
        start,
        tolerance,
        &mut Factors::default(),
        observer,
    )
}

/// Like [`minimise`], using the factors of a similar problem on this system where they help.
pub(super) fn minimise_with(
    system: &System<'_>,
    bound: &[f64],
    start: &State,
    tolerance: f64,
    factors: &mut Factors,
    observer: &mut dyn Observer,
) -> Minimum {
    let mut by_active_set = active_set::run(system, bound, start, tolerance, factors, observer);
    if by_active_set.residual <= tolerance || by_active_set.rounded {
        return by_active_set;
    }
    if observer.stop() {
        if by_active_set.steps == 0 {
            // stopped within the first step: its residual is infinite, which would be taken for an overflow
            let (state, force) = (&by_active_set.state, &by_active_set.elastic_force);
            by_active_set.residual = system.kkt_residual(state, force, bound);
        }
        return by_active_set;
    }
    let mut fallback = projected_newton::run(
        system,
        bound,
        &by_active_set.state,
        tolerance,
        factors,
        observer,
    );
    fallback.steps += by_active_set.steps;
    if fallback.residual <= by_active_set.residual {
        fallback
    } else {
        by_active_set
    }
}
