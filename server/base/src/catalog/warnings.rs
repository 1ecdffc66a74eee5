//! What each warning of a result means, why it matters and what to do: the pages at `/v1/warnings/{code}` and
//! `signorini explain`.

use schemars::JsonSchema;
use serde::Serialize;
use solver::solution::{Severity, WarningCode};

/// The stable facts about a warning.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct WarningKind {
    /// The stable name of the warning.
    pub code: &'static str,
    /// How much the warning matters.
    pub severity: Severity,
    /// The meaning: one line, the same for every warning of the kind.
    pub title: String,
    /// Why it matters.
    pub why: &'static str,
    /// What to do about it.
    pub advice: &'static str,
    /// A drawing in characters, where one helps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<&'static str>,
}

/// The stable facts about this warning; its meaning is taken from the schema of results.
pub fn warning(code: WarningCode) -> WarningKind {
    let schema = schemars::schema_for!(WarningCode).to_value();
    let variants = schema.get("oneOf").and_then(|all| all.as_array());
    let meaning = variants
        .into_iter()
        .flatten()
        .find(|variant| variant["const"] == code.as_str())
        .and_then(|variant| variant["description"].as_str())
        .unwrap_or_default();
    let (why, advice) = reasons(code);
    WarningKind {
        code: code.as_str(),
        severity: code.severity(),
        title: meaning.replace('\n', " ").trim_end_matches('.').to_owned(),
        why,
        advice,
        picture: picture(code),
    }
}

/// Why a warning matters, and what to do.
#[rustfmt::skip] // a warning after the other
#[allow(clippy::too_many_lines)] // data: a text for each code
fn reasons(code: WarningCode) -> (&'static str, &'static str) {
    use WarningCode::*;
    match code {
        LargeTilt => (
            "Gaps are linear in the tilt, as of a small rotation: at 0.05 radians (3°) a point of the obstacle at the distance r from its centre is off by 0.00125 r. Contact along the body's normals moreover leaves out that a rotation about a distant point moves the obstacle's shape along the body.",
            "Draw the obstacle nearer to its final position, so that it turns less, or hold it against turning. A round obstacle that turns about a distant point needs \"normal\": \"obstacle\" and a `direction`."),
        UnitsDisagree => (
            "Forces are integrals of stresses over lengths, so a force in the wrong unit is wrong by a power of ten, and nothing in the computation can notice it.",
            "Use units that belong together, for example mm, N and MPa (1 N/mm² is 1 MPa), or m, N and Pa, and convert every number that was given in another unit."),
        LinesInside => (
            "A support, load or contact acts on the surface of the body only. Lines inside it are left out of the boundary, so that it may be shorter than its name suggests.",
            "If a crack or a joint was meant, the nodes on its two sides must be different nodes. Otherwise remove the lines from the physical curve or the surface of the deck."),
        SupportsOverlap => (
            "Only one of the displacements can hold. The last row was taken, as programs that read such decks do.",
            "Check that the last row is the one that you mean, and delete the others."),
        CentreNodesDropped => (
            "Elements here have 8 nodes. The geometry is the same where the centre node lay in the middle; the solution on the mesh differs slightly from that of 9-node elements.",
            "Nothing, or export 8-node elements (in Gmsh: Mesh.SecondOrderIncomplete = 1)."),
        ElementsReversed => (
            "Elements must be numbered counterclockwise. They were turned around; nothing else changed.",
            "Nothing. If the whole mesh is reversed, the plane may be seen from behind: check that x and y are as you mean them."),
        RaisedToSecondOrder => (
            "Elements here are quadratic. Midside nodes were put in the middle of each side, so that curved boundaries stay polygons.",
            "Export second-order elements, or name the curve of the boundary in mesh.curves, so that its nodes are put onto it."),
        RigidElementsLeftOut => (
            "The elements belong to a rigid tool: they are an obstacle, not part of the elastic body.",
            "Nothing, if the tool is rigid. If it is elastic, remove *RIGID BODY; two elastic bodies in contact cannot be solved yet."),
        DeckDiffers => (
            "The deck asks for something that is solved differently here, so that results may differ from those of the program for which it was written.",
            "Read the message, which names the line and the difference, and decide whether it matters for your purpose."),
        CoincidentNodes => (
            "Two sides that look joined are not: the body has a crack there, which opens without resistance and whose faces do not touch each other.",
            "If the parts should be joined, merge the nodes (in Gmsh: Coherence; in a deck: equal node numbers). If the crack is meant, nothing."),
        StripCutsPolyline => (
            "The strip follows its polyline at grid lines only, and cuts the corners between them.",
            "Put a grid line at each corner of the polyline."),
        ObstacleCutsEdge => (
            "Contact is modelled on whole edges. The part of the last edge that lies below the obstacle is left out, which makes the contact too short by up to that part.",
            "Put a node at the end of the obstacle; grids and adaptive meshes do that by themselves."),
        SmoothingFlattens => (
            "The profile that is pressed is not the measured one any more: with this standard deviation most of its shape counts as noise, and contact areas and peaks are those of a flatter body.",
            "Check the standard deviation: it is that of the noise of a single height, in the unit of length, not the roughness of the surface."),
        DeviationDiffers => (
            "The standard deviation decides how much of the profile is noise, and how large the stated errors are. One that is too small follows the noise, one that is too large removes the shape.",
            "Give the standard deviation of a single height about the true surface, as the instrument's data sheet or repeated measurements have it. If short features of the profile are real, measure them with more points."),
        ElasticSlipLarge => (
            "Friction reaches its bound only where the slip exceeds elastic_slip. Below that it acts as a spring, so that tangential forces and the parts that slip are smaller than those of friction that slips at once.",
            "Choose a thousandth of the obstacle's way, if the length is not known from a measurement; a deck gives it by *FRICTION, ELASTIC SLIP."),
        FactorsSmall => (
            "Values in `steps` multiply those of the contacts: they are factors, not lengths. A length in their place is multiplied by the length in the contact, and the obstacle hardly moves.",
            "Write 1 for the whole indentation or tangential displacement, 0.5 for a half. If the contact has a unit length, so that the factors are lengths, nothing is wrong."),
        NeverApplied => (
            "What the problem gives is multiplied by 0 in every load step, or a step has a factor on what the problem does not have: the result is that of a problem without it.",
            "Name it in the steps that are to apply it: 1 is the whole. tangential_displacement is 0 in a step that does not name it, everything else 1."),
        DragReturns => (
            "The factors of a step are reached from those of the step before. One that leaves tangential_displacement out has 0 there, and drags the obstacle back while it is pushed or unloaded: the friction force changes its sign.",
            "Give the step the tangential_displacement of the step before, or, if the obstacle is to return, a step of its own for that."),
        PathForgotten => (
            "The total law, the law of the thesis, gives friction by the present displacement. It has no memory: a loop is no loop, and nothing remains after unloading. It stands for one monotonic load.",
            "Give \"history\": \"incremental\" in friction, and enough increments in the steps. With the total law the steps are states of their own, whatever their order."),
        LowestPointIsZero => (
            "The lowest of many measured points is one whose error is large and negative. As the zero of the profile it moves the whole obstacle away by that error, as if it were pushed less far.",
            "Subtract the lowest point of a smooth curve through the points, or give the load instead of the indentation. If the zero comes from elsewhere, nothing is wrong."),
        NoiseUndeclared => (
            "Without a standard deviation every point is taken as exact: the contact follows the noise, with peaks that the true surface does not have, and the stated errors do not contain it.",
            "Give \"smoothing\": {\"standard_deviation\": …} with \"interpolation\": \"cubic\", where the points are measured; from_points of the client for Python takes it. Where the roughness is real, refine until its peaks are resolved."),
        FrictionBeyondContact => (
            "The law averages the pressure over nonlocal_radius on either side, so that its friction bound reaches beyond the contact by that length. A part of the friction then acts where the body does not touch, which no surface does.",
            "Nothing, if this is the law that you want. The part is small if nonlocal_radius is a small part of the contact."),
        ContactTurns => (
            "At a corner the normal jumps, and the contact conditions are different on its two sides. Stresses may grow without limit there.",
            "Name the two sides as two contacts, or round the corner."),
        SymmetryMissing => (
            "A half of a symmetric problem needs its line of symmetry: without it the side of the body is free, so that it bulges and the contact ends at its edge. Forces are too small, and the peaks have no limit.",
            "Support the side (ux: 0 for a vertical line of symmetry), or give the obstacle its center if it lies elsewhere. If an edge is really pressed by the middle of the obstacle, nothing is wrong."),
        SymmetricDrag => (
            "A line of symmetry mirrors the drag as well: the half that is not modelled would be dragged the opposite way, which is not what a moving tool does.",
            "Model the whole body, or leave the drag out."),
        RadialDrag => (
            "A rigid body of revolution can move along its axis only. Dragged along the radius it would have to stretch.",
            "Give tangential_displacement 0 on surfaces across the axis; to twist or to slide sideways is not axisymmetric."),
        MaterialJunction => (
            "Where two materials meet at the surface in contact, the pressure has no limit as the mesh is refined. Its value at that node depends on the mesh alone.",
            "Use forces, and the pressure averaged over a length. Do not quote the peak."),
        GapDiffers => (
            "`gap` is the same distance everywhere, for surfaces that fit one another. Where the meshes are farther apart or overlap by more, the bodies touch as if they were drawn otherwise.",
            "Leave `gap` out if the bodies lie as they are drawn; else check the sizes and places of both meshes."),
        CoarserSideCarriesLaw => (
            "Pressure and friction live on the nodes of the boundary that carries the law. Where it is much coarser than the boundary that faces it, the finer mesh opposite is of no use.",
            "Let `boundary` and `against` change places, or refine the boundary that carries the law."),
        ClosingCountsAsSlip => (
            "The total law knows displacements alone. Where the gap closes in another direction than along the normal, a part of the way before the surfaces touch lies along the contact, and counts as slip: σ_t is there where nothing has rubbed.",
            "Let two bodies use \"normal\": \"mean\", and an obstacle with a direction \"normal\": \"obstacle\"; or give \"history\": \"incremental\" with enough increments, which counts from the first touch."),
        MeshTooCoarseForRadius => (
            "The averaged pressure S_ρ is an integral over a length 2ρ. Where edges are longer than ρ, the mesh and not the law decides what is averaged: the result is nearly that of Coulomb's law on this mesh, and σ_t has the mesh's own peaks.",
            "Refine the contact until edges are at most ρ/2, or set mesh.refine to a tolerance, which does it where it matters."),
        MeshTooCoarseForContact => (
            "With few elements in the contact neither its ends nor the peak of the pressure are resolved: a smooth peak is off by about 0.28/n² of itself with n elements across.",
            "Refine there until at least six whole elements touch, or set mesh.refine to a tolerance."),
        NoContact => (
            "All contact forces are zero: the obstacle was not pushed far enough, or from the wrong side.",
            "The message has the smallest gap and the indentation that would close it. Check the sign of the indentation (positive pushes against the body), the obstacle's place and the side of the boundary."),
        ContactOpened => (
            "The body was in contact in an earlier increment, and has left the obstacle: the result is that of the body after unloading. Forces of this contact are zero.",
            "Nothing, if you unload it. Otherwise look at the factors in the load steps: a step has the factor 1 on indentation and loads unless it names another, and an indentation of 0 or less takes the obstacle away."),
        ContactReachesObstacleEnd => (
            "The last point of the obstacle is pressed. If the real surface goes on there, it would press too: the force is too small, and the pressure has a peak that does not exist.",
            "Give more points, or push less. If the surface really ends there, the edge is sharp, and the peak of the pressure has no limit."),
        SharpEdge => (
            "At a sharp edge of a rigid obstacle, or of the body, linear elasticity has no largest pressure: on each finer mesh its value is larger. Forces converge, and so does σ_t with nonlocal_radius > 0, since that averages the pressure.",
            "Nothing: this belongs to the problem. Quote forces and σ_t, not the peak of σ_n. A real edge has a radius: `rounded_flat` models it."),
        FrictionLostAtEnd => (
            "Near an end of the contact boundary part of the averaged pressure lies beyond it, where nothing can carry friction. The total friction force is then less than μ times the normal force even where everything slides.",
            "Choose a smaller nonlocal_radius, or \"normalization\": \"conserving\", which keeps the total."),
        ObstacleBetweenNodes => (
            "Contact is checked along edges as quadratic curves. Between two nodes the obstacle stands in the body, or off it, by more than the mesh can follow.",
            "Refine the contact, or set mesh.refine to a tolerance. A profile with more detail than the mesh should be smoothed."),
        DirectionIsLinear => (
            "Gaps are linear in the push along `direction`. For so long a way the curved obstacle would meet other points of the body first.",
            "Push less, or place the obstacle nearer to the body, so that the way is short."),
        KinkInContact => (
            "At a kink of the obstacle, or at a corner of the body, the pressure grows without limit as the mesh is refined, slowly (as a logarithm) or fast.",
            "Quote forces and averages, not the peak. Where the real shape is smooth, give more points or \"interpolation\": \"cubic\"."),
        RangeCutsMesh => (
            "A boundary or a group that is given by a range has the edges or elements that lie in the range as a whole. Where the range ends inside one, the load, the contact or the material ends before it, on each finer mesh too.",
            "Put a grid line on each end of the range, or choose the range by the lines that there are."),
        PolygonInContact => (
            "The surface of the body has several corners in the contact, as straight sides of elements on a curve make them. Refinement keeps the corners: the result then is that of a polygon, whose force may be off by tens of per cent from that of the curve.",
            "Mesh the curve with elements of second order whose midside nodes lie on it, or name the curve under mesh.curves. If the corners are real, the stated errors hold."),
        PolygonTooCoarse => (
            "The surface of the body in the contact has straight sides, as elements without midside nodes on a curve make them, and refinement keeps them. An arc over a side is so high, compared with the overlap of body and obstacle, that the force may be off by more than 5 % from that of the curve.",
            "Mesh the curve with elements of second order whose midside nodes lie on it, or name the curve under mesh.curves. If the corners are real, the stated errors hold, whatever the verdict."),
        NormalsDiffer => (
            "normal_force is the integral of the pressure along the surface, whichever way it faces. Where the surface turns within the contact, as a hole around a pin does, that is more than the force by which the obstacle is pushed.",
            "Take the force of the message where a force on the tool or a reaction is meant."),
        TotalLaw => (
            "A point that touches early slips or sticks under the pressure that it has then. The total law, the law of the thesis, lets every point slip as if the whole motion had taken place at the final pressure.",
            "Nothing, to compare with the thesis. Otherwise give \"history\": \"incremental\" in friction, and `steps` with enough increments: docs/concepts/history.md has both laws in a figure."),
        RadiusExceedsContact => (
            "S_ρ averages over a length that is larger than the contact: the friction bound is spread beyond the contact and nearly uniform in it.",
            "Check nonlocal_radius and its unit. It is a length of the surface's texture, which is usually much smaller than a contact."),
        BoundBeyondContact => (
            "A prescribed bound acts where it is given, also where the surfaces have separated. There it pulls at a free surface.",
            "Give the bound on the contact only, for example by a table that falls to 0 at its ends."),
        CohesionJumps => (
            "With cohesion the bound does not fall to zero with the pressure: it jumps at the end of the contact, and so does σ_t.",
            "Nothing if the cohesion is meant; then σ_t near the end depends on the mesh. Otherwise set cohesion to 0."),
        OscillatingStick => (
            "Inside stick, σ_t alternates from point to point and cancels in the sum. Forces are right, single values of σ_t are not.",
            "Refine the mesh there, or raise elastic_slip: a thousandth of the indentation or of the obstacle's displacement along the surface, whichever is larger, is small enough where it is not known from a measurement. Or choose \"points\": \"nodal\", or read σ_t as means over edges."),
        UndulationsUnseen => (
            "A curve through noisy points cannot show what is as small as the noise. The pressure follows the curvature, so that a low undulation of short wavelength may change it much.",
            "Nothing, if the surface is known to be smooth, as a ground or a lapped one. Else measure more points or more exactly, and compare."),
        PeakSignUnknown => (
            "The largest tangential stresses of the two directions differ by less than their error. Which is the larger, and with it the sign and the place of `peak_tangential_stress`, may change with the mesh; its size does not.",
            "Quote the size of the peak, or read both peaks from the profile. A finer mesh tells which is the larger."),
        SlowContraction => (
            "Pressure and friction feed each other almost as much as is possible. The solution was found, but a little more friction may have none, or several.",
            "Set \"check_uniqueness\": true if the result matters, and lower the coefficient to see how far away the limit is."),
        NotConverged => (
            "The state is not a solution: its forces and stresses may be far from one.",
            "Look at the convergence plot. Raise elastic_slip, refine the mesh, apply the load in more increments, or use algorithm auto."),
        RoundingLimitsResidual => (
            "elastic_slip is so small beside the displacements that the last digits of these decide between stick and slip.",
            "Raise elastic_slip to the value in the message; it need not be below a thousandth of the obstacle's displacement. The forces are as accurate as stated; places of stick may not be."),
        FalseConvergence => (
            "The iteration stopped by its own criterion at a state that violates the equations: it is not a solution.",
            "Use algorithm auto, which checks the true residual."),
        ContactCycling => (
            "The same contact states repeat: the last one is not a solution.",
            "Use algorithm auto, refine the mesh, or raise elastic_slip."),
        OutOfBalance => (
            "The forces of supports, loads and contacts do not add up: the computed state is not an equilibrium, usually because the body is nearly free to move, or nearly incompressible.",
            "Check the supports. With Poisson's ratio very near to ½, use a slightly smaller one."),
        SlidesAway => (
            "Loads push the body along its contacts by more than friction can hold, and nothing else holds it: there is no equilibrium.",
            "Add a support, lower the load, or raise the coefficient. The message has both forces."),
        LargeSlip => (
            "Gaps are those of the places before deformation. A body that slides farther than its contact is long would touch at other points.",
            "Drag less. For sliding over long ways the obstacle must be placed anew."),
        LargeStrain => (
            "Linear elasticity holds for strains of some per cent. At strains above a quarter forces and extents are off by as much.",
            "Push less, or check the units of indentation and shape. Read the result as a qualitative one."),
        LargeDisplacement => (
            "The equations are those of the undeformed body. Displacements of a tenth of its size change its shape, its contact and the direction of its forces.",
            "Check loads and units. Read the result as a qualitative one."),
        UniquenessUnknown => (
            "The check for a second solution was inconclusive: the solution is one, but there may be others.",
            "Raise max_iterations, or vary the coefficient and look for a jump."),
        NotUnique => (
            "The problem has at least two solutions. Which of them the body takes depends on its history, which a total law does not know.",
            "Give the history: \"history\": \"incremental\" with steps. Do not quote the result as the solution."),
        IncrementsMatter => (
            "The incremental law depends on the path, and with twice as many increments the forces are others: the path is not resolved.",
            "Give the steps more increments until the forces stay."),
        RefinementUnfinished => (
            "Refinement ended before all stated errors were within the tolerance. The result is that of the last mesh, with its stated errors.",
            "The message says what stood in the way: raise the tolerance, begin with a finer mesh where the error is, or round a kink."),
    }
}

/// A drawing of what the warning is about.
fn picture(code: WarningCode) -> Option<&'static str> {
    use WarningCode::*;
    Some(match code {
        SharpEdge => {
            r"       obstacle     |
  __________________|          |  pressure: larger on each
  ======================       |  finer mesh at the edge
       body                ____/"
        }
        ContactReachesObstacleEnd => {
            r"  o--o--o--o   <- last point: does the surface end here,
  ============    or only its measurement?
      body"
        }
        MeshTooCoarseForRadius => {
            r"  edges   |-----------|-----------|
  2 rho        |---|                the average sees one edge"
        }
        MeshTooCoarseForContact => {
            r"         \     obstacle    /
          `-.___________.-'
  ====|===========|===========|====   two elements touch"
        }
        FrictionLostAtEnd => {
            r"  S_rho    ___
       .--'   `-.
      /    |     `.      what lies beyond the end
  ---'     |       `-    of the contact boundary is lost
  =========| end"
        }
        ObstacleBetweenNodes => {
            r"  o---.         .---o   nodes touch,
       `-.   .-'        and the obstacle reaches into
          `-'           the body between them"
        }
        SymmetricDrag => {
            r"     <--  |  -->     a mirror turns the drag around
  ========|========"
        }
        CoincidentNodes => {
            r"  +-----+ +-----+    two nodes at one place:
  |     o o     |    the parts are not joined
  +-----+ +-----+"
        }
        ContactTurns => {
            r"  ======.    one contact on two sides of a corner:
        |    name them as two contacts
        |"
        }
        _ => return None,
    })
}
