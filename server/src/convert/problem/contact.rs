//! Contacts: obstacles and friction laws.

use solver::problem::{
    Along, BoundTable, Condition, Contact, Friction, FrictionPoints, History, Kernel, Measure,
    NormalOf, Normalization, Obstacle, PrescribedBound, Transition,
};

use super::Reader;
use crate::pb;

impl Reader {
    pub(super) fn contact(&mut self, at: &str, message: pb::Contact) -> Option<Contact> {
        let pb::Contact {
            boundary,
            obstacle,
            indentation,
            tangential_displacement,
            friction,
            normal,
            condition,
        } = message;
        let obstacle = self.need(&format!("{at}/obstacle"), obstacle, "an obstacle");
        let obstacle =
            obstacle.and_then(|obstacle| self.obstacle(&format!("{at}/obstacle"), obstacle));
        let friction = match friction {
            Some(friction) => Some(self.friction(&format!("{at}/friction"), friction)?),
            None => None,
        };
        let normal = match self.choice(&format!("{at}/normal"), normal)? {
            pb::NormalOf::Unspecified | pb::NormalOf::Body => NormalOf::Body,
            pb::NormalOf::Obstacle => NormalOf::Obstacle,
        };
        let condition = match self.choice(&format!("{at}/condition"), condition)? {
            pb::Condition::Unspecified | pb::Condition::Unilateral => Condition::Unilateral,
            pb::Condition::Bonded => Condition::Bonded,
            pb::Condition::None => Condition::None,
        };
        Some(Contact {
            boundary,
            obstacle: obstacle?,
            indentation: self.number(&format!("{at}/indentation"), indentation),
            tangential_displacement: self.number(
                &format!("{at}/tangential_displacement"),
                tangential_displacement,
            ),
            normal,
            condition,
            friction,
        })
    }

    #[rustfmt::skip] // one kind per line or two
    fn obstacle(&mut self, at: &str, message: pb::Obstacle) -> Option<Obstacle> {
        use pb::obstacle::Kind;
        let from = self.some_number(&format!("{at}/from"), message.from);
        let to = self.some_number(&format!("{at}/to"), message.to);
        let along = match self.choice(&format!("{at}/along"), message.along)? {
            pb::Along::Unspecified | pb::Along::X => Along::X,
            pb::Along::ArcLength => Along::ArcLength,
        };
        let kinds = "one of flat, circle, parabola, wedge, cone, tilted, power, rounded_flat, table, polyline, line";
        let kind = self.need(&format!("{at}/kind"), message.kind, kinds)?;
        let mut n = |name: &str, value: f64| self.number(&format!("{at}/{name}"), value);
        Some(match kind {
            Kind::Flat(pb::Flat {}) => Obstacle::Flat { from, to, along },
            Kind::Circle(pb::Circle { radius, center }) =>
                Obstacle::Circle { radius: n("radius", radius), center: n("center", center), from, to, along },
            Kind::Parabola(pb::Parabola { radius, center }) =>
                Obstacle::Parabola { radius: n("radius", radius), center: n("center", center), from, to, along },
            Kind::Wedge(pb::Wedge { angle, center }) =>
                Obstacle::Wedge { angle: n("angle", angle), center: n("center", center), from, to, along },
            Kind::Cone(pb::Cone { angle, center }) =>
                Obstacle::Cone { angle: n("angle", angle), center: n("center", center), from, to, along },
            Kind::Tilted(pb::Tilted { slope, center }) =>
                Obstacle::Tilted { slope: n("slope", slope), center: n("center", center), from, to, along },
            Kind::Power(pb::Power { coefficient, exponent, center }) => Obstacle::Power {
                coefficient: n("coefficient", coefficient), exponent: n("exponent", exponent), center: n("center", center),
                from, to, along,
            },
            Kind::RoundedFlat(pb::RoundedFlat { half_width, radius, center }) => Obstacle::RoundedFlat {
                half_width: n("half_width", half_width), radius: n("radius", radius), center: n("center", center),
                from, to, along,
            },
            Kind::Table(pb::Table { x, gap }) => Obstacle::Table {
                x: self.numbers(&format!("{at}/x"), x), gap: self.numbers(&format!("{at}/gap"), gap),
                from, to, along,
            },
            Kind::Polyline(pb::Polyline { points }) =>
                Obstacle::Polyline { points: self.points(&format!("{at}/points"), points), from, to, along },
            Kind::Line(pb::Line { point, angle }) => {
                let angle = n("angle", angle);
                let point = self.need(&format!("{at}/point"), point, "a point")?;
                let pb::Point { x, y } = point;
                let point = [self.number(&format!("{at}/point/0"), x), self.number(&format!("{at}/point/1"), y)];
                Obstacle::Line { point, angle, from, to, along }
            }
        })
    }

    fn friction(&mut self, at: &str, message: pb::Friction) -> Option<Friction> {
        let kernel = match self.choice(&format!("{at}/kernel"), message.kernel)? {
            pb::Kernel::Unspecified | pb::Kernel::Bump => Kernel::Bump,
            pb::Kernel::Parabola => Kernel::Parabola,
        };
        let normalization =
            match self.choice(&format!("{at}/normalization"), message.normalization)? {
                pb::Normalization::Unspecified | pb::Normalization::UnitIntegral => {
                    Normalization::UnitIntegral
                }
                pb::Normalization::PeakOne => Normalization::PeakOne,
            };
        let transition = match self.choice(&format!("{at}/transition"), message.transition)? {
            pb::Transition::Unspecified | pb::Transition::Linear => Transition::Linear,
            pb::Transition::Tanh => Transition::Tanh,
        };
        let history = match self.choice(&format!("{at}/history"), message.history)? {
            pb::History::Unspecified | pb::History::Total => History::Total,
            pb::History::Incremental => History::Incremental,
        };
        let points = match self.choice(&format!("{at}/points"), message.points)? {
            pb::FrictionPoints::Unspecified | pb::FrictionPoints::Gauss3 => FrictionPoints::Gauss3,
            pb::FrictionPoints::Nodal => FrictionPoints::Nodal,
        };
        let measure = match self.choice(&format!("{at}/measure"), message.measure)? {
            pb::Measure::Unspecified | pb::Measure::Line => Measure::Line,
            pb::Measure::Surface => Measure::Surface,
        };
        let bound = message.bound.map(|bound| match bound {
            pb::friction::Bound::ConstantBound(bound) => {
                PrescribedBound::Constant(self.number(&format!("{at}/bound"), bound))
            }
            pb::friction::Bound::BoundTable(table) => PrescribedBound::Table(BoundTable {
                s: self.numbers(&format!("{at}/bound/s"), table.s),
                bound: self.numbers(&format!("{at}/bound/bound"), table.bound),
            }),
        });
        let radius = format!("{at}/nonlocal_radius");
        Some(Friction {
            coefficient: self.some_number(&format!("{at}/coefficient"), message.coefficient),
            nonlocal_radius: self.some_number(&radius, message.nonlocal_radius),
            elastic_slip: self.number(&format!("{at}/elastic_slip"), message.elastic_slip),
            kernel,
            normalization,
            transition,
            history,
            points,
            measure,
            cohesion: self.number(&format!("{at}/cohesion"), message.cohesion),
            shear_cap: self.some_number(&format!("{at}/shear_cap"), message.shear_cap),
            bound,
        })
    }
}
