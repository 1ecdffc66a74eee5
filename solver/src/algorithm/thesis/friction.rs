//! The friction of the thesis's iteration: a load computed from the previous iteration.

use crate::problem::ThesisOptions;

/// The friction bound and traction at every friction point.
#[derive(Clone)]
pub(super) struct Friction {
    /// The bound τ = μ max(S, 0) (stress).
    pub(super) bound: Vec<f64>,
    /// The traction σ_t on the body, along t (stress); F̂ is the load of −σ_t.
    pub(super) traction: Vec<f64>,
}

/// The ratio σ_t / τ for a given φ: against the motion with the option `signed`, else along +t.
pub(super) fn signed_ratio(phi: f64, options: &ThesisOptions) -> f64 {
    if options.signed { -phi } else { phi.abs() }
}

/// Moves `friction` towards `new` by a part of their difference.
pub(super) fn relax(friction: &mut Friction, new: Friction, part: f64) {
    let mix = |old: &mut Vec<f64>, new: Vec<f64>| {
        old.iter_mut()
            .zip(new)
            .for_each(|(old, new)| *old += part * (new - *old));
    };
    mix(&mut friction.bound, new.bound);
    mix(&mut friction.traction, new.traction);
}
