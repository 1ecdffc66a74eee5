//! Checks of single obstacles and friction laws: every number in its range, no two options that exclude
//! each other.

use super::checks::Checks;
use crate::error::{AllChecks, Checked, Reason};
use crate::friction::{Average, BoundLaw, FrictionLaw};
use crate::problem::{
    Analysis, Condition, Contact, Friction, History, Interpolation, Measure, Normalization,
    Obstacle, PrescribedBound, Smoothing, Transition, elastic_slip_rule,
};
use crate::solution::WarningCode;
use crate::spline::{noise, rounding, scatter};

/// The largest number of points of a table.
const MOST_TABLE_POINTS: usize = 100_000;

/// The largest number of points of a polyline: each is tested from every place of the boundary.
const MOST_LINE_POINTS: usize = 10_000;

/// The smallest number of points for smoothing.
const FEWEST_SMOOTHED: usize = 4;

/// The height of an undulation, in standard deviations, that adds as much to the misfit of a curve as noise does: √2.
const UNSEEN: f64 = std::f64::consts::SQRT_2;

/// A standard deviation above this fraction of the range of all values can hardly be the error of a single value.
const LARGE_DEVIATION: f64 = 0.1;

/// By how many of its own standard deviations the scatter of points may differ from the declared deviation without a
/// warning: enough for the roundness of a profile and for noise that is not quite normal.
const MOST_SCATTER: f64 = 5.0;

/// The part of the indentation above which noise of an obstacle's points changes pressures by per cents: on meshes of ten or
/// more elements across the contact, ten times as much.
const LEAST_NOISE: f64 = 1e-3;

/// The part of the way of the obstacle above which an elastic slip changes tangential forces by some per cent: a cylinder that
/// is dragged by five times the elastic slip has 7 % less than with a thousandth of it.
const LARGE_ELASTIC_SLIP: f64 = 0.1;

impl Checks {
    /// Checks the direction of a push, which must not be zero; a body of revolution is pushed along its axis.
    pub(super) fn push_direction(
        &mut self,
        analysis: &Analysis,
        direction: Option<[f64; 2]>,
        pointer: &str,
    ) -> Checked {
        let Some([x, y]) = direction else {
            return Ok(());
        };
        let radial = matches!(analysis, Analysis::Axisymmetric {}) && x != 0.0;
        match x.hypot(y) {
            length if length > 0.0 && length.is_finite() && !radial => Ok(()),
            _ => Err(self.report(
                pointer,
                Reason::OutOfRange,
                format!("[{x}, {y}]"),
                if radial {
                    "a direction along the axis: [0, 1] or [0, −1]"
                } else {
                    "a direction, such as [0, −1]"
                },
                "A rigid body moves in one direction; a rigid ring can move along the axis only.",
            )),
        }
    }

    /// Checks the numbers of an obstacle.
    pub(super) fn obstacle(&mut self, obstacle: &Obstacle, pointer: &str) -> Checked {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        let lengths = "a length > 0";
        match obstacle {
            Obstacle::Circle { radius, .. }
            | Obstacle::Parabola { radius, .. }
            | Obstacle::RoundedFlat { radius, .. } => {
                let hint = "The obstacle must be convex towards the body.";
                all.check(self.require(*radius > 0.0, at("radius"), *radius, lengths, hint));
            }
            Obstacle::Wedge { angle, .. } | Obstacle::Cone { angle, .. } => {
                all.check(self.require(
                    *angle > 0.0 && *angle < 90.0,
                    at("angle"),
                    *angle,
                    "0 < angle < 90 degrees",
                    "Between the obstacle's face and the surface of the body.",
                ));
            }
            Obstacle::Power {
                coefficient,
                exponent,
                ..
            } => {
                let hint = "The obstacle must be convex towards the body.";
                all.check(self.require(
                    *coefficient > 0.0,
                    at("coefficient"),
                    *coefficient,
                    "> 0",
                    hint,
                ));
                all.check(self.require(*exponent >= 1.0, at("exponent"), *exponent, "≥ 1", hint));
            }
            Obstacle::Table {
                x,
                gap,
                interpolation,
                smoothing,
                ..
            } => {
                all.check(self.few_enough(&at("x"), x.len(), MOST_TABLE_POINTS));
                let sound = all.check(self.table(&at("x"), x, &at("gap"), gap, "profile"));
                if let Some(smoothing) = smoothing {
                    all.check(self.smoothing(pointer, x, *interpolation, smoothing));
                    if sound.is_some() {
                        self.warn_of_smoothing(pointer, x, gap, smoothing);
                    }
                }
            }
            Obstacle::Polyline { points, .. } => {
                all.check(self.few_enough(&at("points"), points.len(), MOST_LINE_POINTS));
                if points.len() < 2 {
                    all.fail(self.report(
                        at("points"),
                        Reason::TooFew,
                        format!("{} point(s)", points.len()),
                        "at least two points",
                        "Give the two ends of the line.",
                    ));
                }
                if let Some(i) = (1..points.len()).find(|&i| points[i] == points[i - 1]) {
                    all.fail(self.report(
                        format!("{pointer}/points/{i}"),
                        Reason::RepeatedPoint,
                        format!("{:?} twice", points[i]),
                        "points that differ from the previous ones",
                        "Remove one of the two equal points.",
                    ));
                }
            }
            Obstacle::Flat { .. } | Obstacle::Tilted { .. } | Obstacle::Line { .. } => {}
        }
        if let Obstacle::RoundedFlat { half_width, .. } = obstacle {
            all.check(self.require(
                *half_width >= 0.0,
                at("half_width"),
                *half_width,
                "a length ≥ 0",
                "Half the width of the flat part.",
            ));
        }
        if let (Some(from), Some(to), _) = obstacle.span()
            && from >= to
        {
            all.fail(self.report(
                at("to"),
                Reason::OutOfRange,
                to,
                format!("more than `from`, {from}"),
                "`from` and `to` are the ends of the obstacle.",
            ));
        }
        all.finish(())
    }

    fn few_enough(&mut self, pointer: &str, count: usize, most: usize) -> Checked {
        if count <= most {
            Ok(())
        } else {
            Err(self.report(
                pointer,
                Reason::TooMany,
                format!("{count} points"),
                format!("at most {most}"),
                "Give every second or tenth point: a mesh cannot resolve more.",
            ))
        }
    }

    /// Checks the smoothing of a table.
    fn smoothing(
        &mut self,
        pointer: &str,
        x: &[f64],
        interpolation: Interpolation,
        smoothing: &Smoothing,
    ) -> Checked {
        let mut all = AllChecks::default();
        let deviation = smoothing.standard_deviation;
        all.check(self.require(
            deviation > 0.0,
            format!("{pointer}/smoothing/standard_deviation"),
            deviation,
            "a length > 0",
            "The standard deviation of the error of one measured point, in the unit of `gap`; without errors remove `smoothing`.",
        ));
        if interpolation != Interpolation::Cubic {
            all.fail(self.report(
                format!("{pointer}/interpolation"),
                Reason::NotUsed,
                "`linear` (the default) with `smoothing`",
                "`cubic`",
                "Between smoothed points straight lines still have kinks: write \"interpolation\": \"cubic\".",
            ));
        }
        if x.len() < FEWEST_SMOOTHED {
            all.fail(self.report(
                format!("{pointer}/x"),
                Reason::TooFew,
                format!("{} point(s)", x.len()),
                format!("at least {FEWEST_SMOOTHED} points to smooth"),
                "A parabola passes through any three: remove `smoothing`, or give more points.",
            ));
        }
        all.finish(())
    }

    /// Warns of a standard deviation that is probably in another unit, which would smooth any profile to a parabola, and of
    /// one that differs from the scatter of the points.
    fn warn_of_smoothing(&mut self, pointer: &str, x: &[f64], gap: &[f64], smoothing: &Smoothing) {
        let least = gap.iter().copied().fold(f64::INFINITY, f64::min);
        let most = gap.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (deviation, range) = (smoothing.standard_deviation, most - least);
        if deviation > LARGE_DEVIATION * range {
            self.warn(
                WarningCode::SmoothingFlattens,
                &format!("{pointer}/smoothing/standard_deviation"),
                format!("The standard deviation {deviation:.3e} is more than {:.0} % of the range of all values, {range:.3e}: smoothing leaves little of the profile. It is the error of one point, in the unit of `gap`.", 100.0 * LARGE_DEVIATION),
            );
            return;
        }
        self.warn(
            WarningCode::UndulationsUnseen,
            &format!("{pointer}/smoothing"),
            format!("Undulations of the surface up to about {:.1e} high cannot be told from noise of this deviation, and smoothing removes them. If the surface may have any, of a height A and a wavelength λ, they change the pressure by π E* A/λ, which no stated error contains. More points, or more exact ones, show them.", UNSEEN * deviation),
        );
        if least == 0.0 {
            self.warn(
                WarningCode::LowestPointIsZero,
                &format!("{pointer}/gap"),
                format!("The lowest measured point is exactly 0. If the profile was shifted by that point, the point's own error, of one to three standard deviations ({deviation:.3e}), shifts the whole obstacle against the indentation, which no stated error contains. Shift it by the lowest point of a smooth curve through the points, or apply a known load."),
            );
        }
        let Some([scatter, uncertainty]) = scatter(x, gap) else {
            return;
        };
        let most = 1.0 + MOST_SCATTER * uncertainty;
        let effect = if scatter > most * deviation {
            "smoothing follows the noise, and the stated errors are too small. Give the deviation of the points, if the profile has no features as short as their distance"
        } else if deviation > most * scatter {
            "smoothing may remove parts of the profile, and the stated errors are too large, unless the errors of neighbouring points are alike. Give the deviation of the points"
        } else {
            return;
        };
        self.warn(
            WarningCode::DeviationDiffers,
            &format!("{pointer}/smoothing/standard_deviation"),
            format!(
                "The standard deviation is {deviation:.3e}, but the points scatter by {scatter:.3e} about the curve through their neighbours: {effect}."
            ),
        );
    }

    /// Warns of points that scatter as measured ones do, and are taken as exact.
    pub(super) fn warn_of_noise(&mut self, contact: &Contact, pointer: &str) {
        let [x, y] = match &contact.obstacle {
            Some(Obstacle::Table {
                x,
                gap,
                smoothing: None,
                ..
            }) if x.len() == gap.len() => [x.clone(), gap.clone()],
            Some(Obstacle::Polyline { points, .. }) => {
                [0, 1].map(|k| points.iter().map(|p| p[k]).collect())
            }
            _ => return,
        };
        if x.windows(2).any(|pair| pair[1] <= pair[0]) {
            return;
        }
        let least = y.iter().copied().fold(f64::INFINITY, f64::min);
        let most = y.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let size = match contact.indentation.abs() {
            0.0 => most - least,
            pushed => pushed,
        };
        let Some(deviation) = noise(&x, &y).filter(|noise| *noise > LEAST_NOISE * size) else {
            if let Some(step) = rounding(&x, &y) {
                // that of a number anywhere between two steps
                let deviation = step / 12f64.sqrt();
                self.warn(
                    WarningCode::NoiseUndeclared,
                    pointer,
                    format!("The points are rounded to {step:e}, which changes the curvature of their curve from point to point: the pressure follows that, and no stated error contains it. Give more digits; or, if they are measured, a `table` with \"interpolation\": \"cubic\" and \"smoothing\": {{\"standard_deviation\": {deviation:.1e}}}, or what is known of the instrument."),
                );
            }
            return;
        };
        self.warn(
            WarningCode::NoiseUndeclared,
            pointer,
            format!("The points scatter by {deviation:.1e} about the curve through their neighbours, as measured ones do, and are taken as exact: the pressure follows this noise, and no stated error contains it. If they are measured, give a `table` with \"interpolation\": \"cubic\" and \"smoothing\": {{\"standard_deviation\": {deviation:.1e}}}, or what is known of the instrument."),
        );
    }

    /// Checks a table: at least two strictly increasing places `x`, and one value of `y` for each.
    fn table(&mut self, x_at: &str, x: &[f64], y_at: &str, y: &[f64], what: &str) -> Checked {
        let mut all = AllChecks::default();
        if x.len() < 2 {
            all.fail(self.report(
                x_at,
                Reason::TooFew,
                format!("{} point(s)", x.len()),
                "at least two points",
                format!("Two points give a {what} that is a straight line."),
            ));
        }
        if let Some(i) = (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
            all.fail(self.report(
                format!("{x_at}/{i}"),
                Reason::NotIncreasing,
                format!("{} after {}", x[i], x[i - 1]),
                "strictly increasing places",
                "Sort the points and remove repeated ones.",
            ));
        }
        if x.len() != y.len() {
            all.fail(self.report(
                y_at,
                Reason::WrongLength,
                format!("{} values", y.len()),
                format!("{}, one for each place", x.len()),
                "Give one value for each place.",
            ));
        }
        all.finish(())
    }

    /// Checks the friction law of a contact: all its parts are given, and its numbers are in their range and compatible
    /// with the contact.
    pub(super) fn friction(
        &mut self,
        analysis: &Analysis,
        contact: &Contact,
        pointer: &str,
    ) -> (Option<FrictionLaw<Average>>, Checked) {
        let mut all = AllChecks::default();
        match (&contact.friction, contact.condition) {
            (Some(_), Condition::Bonded) => all.fail(self.report(
                pointer,
                Reason::NotUsed,
                "friction on a bonded contact",
                "no friction: a bonded contact does not slide",
                "Remove `friction`, or choose another `condition`.",
            )),
            (friction, Condition::None) if friction.as_ref().is_none_or(|f| f.bound.is_none()) => {
                all.fail(self.report(
                    format!("{pointer}/bound"),
                    Reason::Missing,
                    "nothing",
                    "a prescribed friction bound",
                    "Without an obstacle there is no pressure to compute a bound from.",
                ));
            }
            _ => {}
        }
        let Some(friction) = &contact.friction else {
            return (None, all.finish(()));
        };
        let (bound, sound) = match &friction.bound {
            Some(bound) => self.prescribed_bound(friction, bound, pointer),
            None => self.pressure_bound(friction, pointer),
        };
        all.check(sound);
        all.check(self.slip(analysis, contact, friction, pointer));
        let law = bound.map(|bound| FrictionLaw {
            bound,
            elastic_slip: friction.elastic_slip,
            transition: friction.transition,
            history: friction.history,
            points: friction.points,
        });
        (law, all.finish(()))
    }

    /// Checks a friction bound that follows from the pressure.
    fn pressure_bound(
        &mut self,
        friction: &Friction,
        pointer: &str,
    ) -> (Option<BoundLaw<Average>>, Checked) {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        let numbers = [
            (
                "coefficient",
                friction.coefficient,
                "a number ≥ 0",
                "Remove `friction` for frictionless contact.",
            ),
            (
                "nonlocal_radius",
                friction.nonlocal_radius,
                "a length ≥ 0",
                "0 is Coulomb's local law.",
            ),
        ];
        for (name, value, expected, hint) in numbers {
            all.check(match value {
                Some(value) => self.require(value >= 0.0, at(name), value, expected, hint),
                None => Err(self.report(
                    at(name),
                    Reason::Missing,
                    "nothing",
                    format!("{expected}, or a `bound`"),
                    hint,
                )),
            });
        }
        all.check(self.require(
            friction.cohesion >= 0.0,
            at("cohesion"),
            friction.cohesion,
            "a stress ≥ 0",
            "Cohesion is added to the friction bound in contact.",
        ));
        if let Some(cap) = friction.shear_cap {
            let hint = "The largest tangential stress that the surface can bear.";
            all.check(self.require(cap > 0.0, at("shear_cap"), cap, "a stress > 0", hint));
        }
        let law = match (friction.coefficient, friction.nonlocal_radius) {
            (Some(coefficient), Some(radius)) => Some(BoundLaw::Pressure {
                coefficient,
                cohesion: friction.cohesion,
                shear_cap: friction.shear_cap.unwrap_or(f64::INFINITY),
                average: Average {
                    radius,
                    kernel: friction.kernel,
                    normalization: friction.normalization,
                    measure: friction.measure,
                },
            }),
            _ => None,
        };
        (law, all.finish(()))
    }

    /// Checks a prescribed friction bound, with which the fields that a bound would be computed from are not allowed.
    fn prescribed_bound(
        &mut self,
        friction: &Friction,
        bound: &PrescribedBound,
        pointer: &str,
    ) -> (Option<BoundLaw<Average>>, Checked) {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        for (name, given) in [
            ("coefficient", friction.coefficient.is_some()),
            ("nonlocal_radius", friction.nonlocal_radius.is_some()),
            ("cohesion", friction.cohesion != 0.0),
            ("shear_cap", friction.shear_cap.is_some()),
        ] {
            if given {
                all.fail(self.report(
                    at(name),
                    Reason::NotUsed,
                    "a value in addition to `bound`",
                    "either this field or `bound`",
                    "A prescribed bound does not depend on pressure; remove this field or `bound`.",
                ));
            }
        }
        let (stress, hint) = (
            "a stress ≥ 0",
            "The tangential stress at which the surface slips.",
        );
        match bound {
            PrescribedBound::Constant(bound) => {
                all.check(self.require(*bound >= 0.0, at("bound"), *bound, stress, hint));
            }
            PrescribedBound::Table(table) => {
                let (s, bound) = (at("bound/s"), at("bound/bound"));
                all.check(self.table(&s, &table.s, &bound, &table.bound, "friction bound"));
                if let Some(i) = table.bound.iter().position(|b| *b < 0.0) {
                    let place = format!("{bound}/{i}");
                    all.check(self.require(false, place, table.bound[i], stress, hint));
                }
            }
        }
        (Some(BoundLaw::Prescribed(bound.clone())), all.finish(()))
    }

    /// Warns of an elastic slip that is a large part of the way along which the obstacle is dragged or, without drag, pushed.
    fn warn_of_elastic_slip(&mut self, contact: &Contact, elastic_slip: f64, pointer: String) {
        let dragged = contact.tangential_displacement.abs();
        let (way, how) = match dragged > 0.0 {
            true => (dragged, "dragged"),
            false => (contact.pushed().abs(), "pushed"),
        };
        let moved = match contact.against {
            None => format!("the obstacle is {how}"),
            Some(_) => "the bodies overlap".to_owned(),
        };
        if way > 0.0 && elastic_slip > LARGE_ELASTIC_SLIP * way {
            let rule = elastic_slip_rule(way, 0.0);
            self.warn(
                WarningCode::ElasticSlipLarge,
                &pointer,
                format!("The elastic slip {elastic_slip:.1e} is {:.0} % of the {way:.1e} that {moved}: until it has slipped that far friction acts as a spring below its bound, and tangential forces are too small for friction that slips at once. {rule}", 100.0 * elastic_slip / way),
            );
        }
    }

    /// Checks the transition from stick to slip.
    fn slip(
        &mut self,
        analysis: &Analysis,
        contact: &Contact,
        friction: &Friction,
        pointer: &str,
    ) -> Checked {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        all.check(self.require(
            friction.elastic_slip > 0.0,
            at("elastic_slip"),
            friction.elastic_slip,
            "a length > 0",
            &elastic_slip_rule(contact.pushed(), contact.tangential_displacement),
        ));
        self.warn_of_elastic_slip(contact, friction.elastic_slip, at("elastic_slip"));
        if friction.history == History::Incremental && friction.transition != Transition::Linear {
            all.fail(self.report(
                at("transition"),
                Reason::NotUsed,
                "another transition with the incremental history",
                "`linear`",
                "The incremental law is defined for the linear transition only.",
            ));
        }
        let round = matches!(analysis, Analysis::Axisymmetric {});
        if friction.measure == Measure::Surface
            && friction.normalization == Normalization::Conserving
        {
            all.fail(self.report(
                at("normalization"),
                Reason::Unsupported,
                "`conserving` with `measure: surface`",
                "`unit_integral` or `peak_one`, or `measure: line`",
                "Only averages along the boundary can conserve the force on it.",
            ));
        }
        if friction.measure == Measure::Surface && !round {
            all.fail(self.report(
                at("measure"),
                Reason::NotUsed,
                "`surface`",
                "`line` (`surface` only in axisymmetry)",
                "In the plane there is no surface to integrate over.",
            ));
        }
        all.finish(())
    }
}
