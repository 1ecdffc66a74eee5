//! Contacts as messages.

use solver::problem::{
    Along, Condition, Contact, Friction, FrictionPoints, History, Kernel, Measure, NormalOf,
    Normalization, Obstacle, PrescribedBound, Transition,
};

use crate::pb;

pub(super) fn contact_to_pb(contact: &Contact) -> pb::Contact {
    pb::Contact {
        boundary: contact.boundary.clone(),
        obstacle: Some(obstacle_to_pb(&contact.obstacle)),
        indentation: contact.indentation,
        tangential_displacement: contact.tangential_displacement,
        friction: contact.friction.as_ref().map(friction_to_pb),
        normal: match contact.normal {
            NormalOf::Body => pb::NormalOf::Body.into(),
            NormalOf::Obstacle => pb::NormalOf::Obstacle.into(),
        },
        condition: match contact.condition {
            Condition::Unilateral => pb::Condition::Unilateral.into(),
            Condition::Bonded => pb::Condition::Bonded.into(),
            Condition::None => pb::Condition::None.into(),
        },
    }
}

#[rustfmt::skip] // one kind per line or two
fn obstacle_to_pb(obstacle: &Obstacle) -> pb::Obstacle {
    use pb::obstacle::Kind;
    let point = |&[x, y]: &[f64; 2]| pb::Point { x, y };
    let kind = match *obstacle {
        Obstacle::Flat { .. } => Kind::Flat(pb::Flat {}),
        Obstacle::Circle { radius, center, .. } => Kind::Circle(pb::Circle { radius, center }),
        Obstacle::Parabola { radius, center, .. } => Kind::Parabola(pb::Parabola { radius, center }),
        Obstacle::Wedge { angle, center, .. } => Kind::Wedge(pb::Wedge { angle, center }),
        Obstacle::Cone { angle, center, .. } => Kind::Cone(pb::Cone { angle, center }),
        Obstacle::Tilted { slope, center, .. } => Kind::Tilted(pb::Tilted { slope, center }),
        Obstacle::Power { coefficient, exponent, center, .. } => Kind::Power(pb::Power { coefficient, exponent, center }),
        Obstacle::RoundedFlat { half_width, radius, center, .. } =>
            Kind::RoundedFlat(pb::RoundedFlat { half_width, radius, center }),
        Obstacle::Table { ref x, ref gap, .. } => Kind::Table(pb::Table { x: x.clone(), gap: gap.clone() }),
        Obstacle::Polyline { ref points, .. } => Kind::Polyline(pb::Polyline { points: points.iter().map(point).collect() }),
        Obstacle::Line { point: ref at, angle, .. } => Kind::Line(pb::Line { point: Some(point(at)), angle }),
    };
    let (from, to, along) = obstacle.span();
    let along = match along {
        Along::X => pb::Along::X,
        Along::ArcLength => pb::Along::ArcLength,
    };
    pb::Obstacle { kind: Some(kind), from, to, along: along.into() }
}

fn friction_to_pb(friction: &Friction) -> pb::Friction {
    let bound = |bound: &PrescribedBound| match bound {
        PrescribedBound::Constant(bound) => pb::friction::Bound::ConstantBound(*bound),
        PrescribedBound::Table(table) => pb::friction::Bound::BoundTable(pb::BoundTable {
            s: table.s.clone(),
            bound: table.bound.clone(),
        }),
    };
    pb::Friction {
        coefficient: friction.coefficient,
        nonlocal_radius: friction.nonlocal_radius,
        elastic_slip: friction.elastic_slip,
        kernel: match friction.kernel {
            Kernel::Bump => pb::Kernel::Bump.into(),
            Kernel::Parabola => pb::Kernel::Parabola.into(),
        },
        normalization: match friction.normalization {
            Normalization::UnitIntegral => pb::Normalization::UnitIntegral.into(),
            Normalization::PeakOne => pb::Normalization::PeakOne.into(),
        },
        transition: match friction.transition {
            Transition::Linear => pb::Transition::Linear.into(),
            Transition::Tanh => pb::Transition::Tanh.into(),
        },
        history: match friction.history {
            History::Total => pb::History::Total.into(),
            History::Incremental => pb::History::Incremental.into(),
        },
        points: match friction.points {
            FrictionPoints::Gauss3 => pb::FrictionPoints::Gauss3.into(),
            FrictionPoints::Nodal => pb::FrictionPoints::Nodal.into(),
        },
        measure: match friction.measure {
            Measure::Line => pb::Measure::Line.into(),
            Measure::Surface => pb::Measure::Surface.into(),
        },
        cohesion: friction.cohesion,
        shear_cap: friction.shear_cap,
        bound: friction.bound.as_ref().map(bound),
    }
}
