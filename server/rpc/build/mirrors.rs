//! Which Rust type mirrors which message or enum of the contract. From this list and the contract
//! `conversions` writes the code between the two, field by field and value by value: a field or a value that
//! only one side has does not compile, or is named here.
//!
//! Types whose shape differs from that of the message are not in this list; `src/convert` converts them by hand.

/// A message or an enum of the contract, and the Rust type with the same content.
pub(crate) struct Mirror {
    /// Its name in the contract.
    pub message: &'static str,
    /// The type, by the names that `src/convert/conversions.rs` imports.
    pub rust: &'static str,
    pub shape: Shape,
    /// It is read from requests. Every type is written, to responses or to the requests of our own clients.
    pub read: bool,
    /// Fields that a message leaves out have the values of the type's `Default`.
    pub defaulted: bool,
    /// The same for a single field: its name and its default.
    pub otherwise: Option<(&'static str, &'static str)>,
    /// A field that has another name in our type, and that name.
    pub renamed: Option<(&'static str, &'static str)>,
    /// Fields of our type that are not fields of the message: the patterns that match them.
    pub ours: &'static [&'static str],
    /// Fields of the message that our type does not have, each as `name: value` for the expression that builds the message.
    pub theirs: &'static [&'static str],
}

/// How our type holds the content of a message.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// A struct with the fields of the message. Alternatives (`oneof`) are one field, of their common name.
    Fields,
    /// An enum with a variant for each alternative of the message's `kind`. A variant has the fields of its
    /// alternative, and those that the message has beside `kind`.
    Kinds,
    /// An array of the fields.
    Array,
    /// The content of the only field.
    Content,
    /// An enum without data, with the names of the contract.
    Names,
}

#[rustfmt::skip] // one per line
pub(crate) const MIRRORS: &[Mirror] = &[
    // the problem
    fields("Problem", "problem::Problem").otherwise("quadrature", "problem::default_quadrature()"),
    fields("Units", "problem::Units"),
    kinds("Analysis", "problem::Analysis"),
    fields("AdaptiveRefine", "problem::AdaptiveRefine"),
    fields("ElementRange", "problem::ElementRange"),
    fields("Curve", "problem::Curve"),
    names("CurveKind", "problem::CurveKind"),
    fields("Grid", "problem::Grid"),
    fields("InlineMesh", "problem::InlineMesh"),
    fields("BoundaryPart", "problem::BoundaryPart").renamed("box", "corners"),
    array("Point", "[f64; 2]"),
    array("Range", "[f64; 2]"),
    array("Vector", "[f64; 2]"),
    array("Box", "[[f64; 2]; 2]"),
    content("Element", "Element"),
    content("Edge3", "[u32; 3]"),
    content("EdgeList", "Vec<[u32; 3]>"),
    content("ElementList", "Vec<u32>"),
    content("NodeList", "Vec<u32>"),
    fields("Material", "problem::MaterialFields"),
    fields("Orthotropic", "problem::Orthotropic"),
    array("Expansion", "[f64; 3]"),
    fields("Support", "problem::Support"),
    fields("SpringStiffness", "problem::SpringStiffness"),
    fields("Load", "problem::LoadFields"),
    fields("Rotation", "problem::Rotation"),
    array("Traction", "[problem::BoundaryValue; 2]"),
    content("NodalForces", "Vec<[f64; 2]>"),
    fields("Contact", "problem::Contact"),
    fields("Against", "problem::Against"),
    fields("BodyGap", "problem::BodyGap"),
    fields("ObstacleStiffness", "problem::ObstacleStiffness"),
    names("NormalOf", "problem::NormalOf").defaulted(),
    names("Condition", "problem::Condition").defaulted(),
    kinds("Obstacle", "problem::Obstacle"),
    names("Interpolation", "problem::Interpolation").defaulted(),
    fields("Smoothing", "problem::Smoothing"),
    names("Along", "problem::Along").defaulted(),
    fields("Friction", "problem::Friction"),
    fields("BoundTable", "problem::BoundTable"),
    names("FrictionPoints", "problem::FrictionPoints").defaulted(),
    names("Measure", "problem::Measure").defaulted(),
    names("Kernel", "problem::Kernel").defaulted(),
    names("Normalization", "problem::Normalization").defaulted(),
    names("Transition", "problem::Transition").defaulted(),
    names("History", "problem::History").defaulted(),
    fields("Step", "problem::Step").defaulted(),
    names("Spacing", "problem::Spacing").defaulted(),
    fields("SolverControls", "problem::SolverControls").defaulted(),
    fields("ThesisOptions", "problem::ThesisOptions").defaulted(),
    names("ThesisPressure", "problem::ThesisPressure").defaulted(),
    names("Algorithm", "problem::Algorithm").defaulted(),
    names("AccuracyMode", "problem::AccuracyMode").defaulted(),

    // the checks of a problem
    fields("ValidateProblemResponse", "problems::Validation").answer(),
    fields("Violation", "solver::error::Violation").answer(),
    fields("Warning", "solution::Warning").answer().ours(&["code"])
        .theirs(&["severity: pb::Severity::from(code.severity()).into()", "code: code.into_message()"]),
    names("Severity", "solution::Severity").answer(),
    fields("Estimate", "solver::Estimate").answer(),
    fields("ConvertDeckResponse", "problems::Converted").answer(),

    // jobs
    fields("Limits", "job::Limits").defaulted(),
    names("Cache", "job::Cache").defaulted(),
    fields("Job", "job::Job").answer().ours(&["key: _", "mesh: _", "memory_bytes: _", "coalesced_into: _", "cache: _", "links: _"]),
    names("Status", "job::Status"),
    names("ResultAvailable", "job::ResultAvailable").answer(),
    fields("QueuePosition", "job::QueuePosition").answer(),
    fields("JobProgress", "job::Progress").answer(),
    fields("Failure", "job::Failure").answer(),
    fields("CountJobsResponse", "lists::Count").answer(),
    fields("CancelJobsResponse", "bulk::BulkResult").answer(),
    fields("DeleteJobsResponse", "bulk::BulkResult").answer(),
    names("CancelJobResponse.Outcome", "jobs::Cancellation").answer(),

    // results
    fields("Iteration", "solution::Iteration").answer().ours(&[
        "contact: solution::ContactCount { active, entered, left }",
        "friction: solution::FrictionCount { slip, stick }",
        "force: solution::ForcePair { normal: normal_force, tangential: tangential_force }",
    ]).theirs(&["wall_s: 0.0", "seq: None"]),
    fields("ObstacleMotion", "solution::ObstacleMotion").answer(),
    fields("Result", "results::JobResult").answer(),
    fields("Assessment", "accuracy::Assessment").answer(),
    fields("Finding", "accuracy::Finding").answer(),
    names("FindingCode", "accuracy::FindingCode").answer(),
    fields("StepResult", "results::StepResult").answer(),
    fields("Summary", "solution::Summary").answer()
        .theirs(&["timings: BTreeMap::new()", "body_reused: None", "solver_version: String::new()", "input_hash: String::new()", "digest: String::new()"]),
    fields("Accuracy", "solution::Accuracy").answer(),
    names("Verdict", "solution::Verdict"),
    fields("EstimatedQuantity", "solution::EstimatedQuantity").answer(),
    names("QuantityName", "solution::QuantityName").answer(),
    names("ErrorMethod", "solution::ErrorMethod").answer(),
    fields("Comparison", "solution::Comparison").answer(),
    fields("Refinement", "solution::Refinement").answer(),
    names("Outcome", "solution::Outcome").answer(),
    fields("ContactSummary", "solution::ContactSummary").answer().ours(&["widths: _"]),
    fields("Peak", "solution::Peak").answer(),
    fields("Residuals", "solution::Residuals").answer(),
    fields("ContactProfile", "solution::ContactProfile").answer(),
    names("NodeState", "solution::NodeState").answer(),

    // sweeps
    fields("Sweep", "sweep::Sweep").answer().ours(&["key: _", "links: _"]),
    fields("MemberCounts", "sweep::MemberCounts").answer(),
    fields("SweepMember", "sweep::MemberRow").answer(),

    // the service
    fields("ServerInfo", "info::Info").answer(),
    names("Isolation", "Isolation").answer(),
    fields("ServiceLimits", "info::ServiceLimits").answer(),
    fields("BodyCache", "bodies::BodyCache").answer(),
    fields("QueueState", "queue::QueueState").answer(),
    fields("ListWaitingResponse", "queue::Forecast").answer(),
    fields("WaitingJob", "queue::WaitingJob").answer(),
    fields("LoadPoint", "LoadPoint").answer(),
    fields("ListWorkersResponse", "workers::Workers").answer(),
    fields("Worker", "WorkerState").answer(),
    fields("ListExamplesResponse", "examples::Examples").answer(),
    fields("Example", "examples::Example").answer(),
    fields("Caller", "info::Me").answer(),
    fields("Share", "info::Share").answer(),
    fields("Kept", "info::Kept").answer(),
    fields("Rate", "info::Rate").answer(),
    fields("Disk", "info::Disk").answer(),
    fields("Retention", "info::Retention").answer(),
    fields("OwnerUse", "info::OwnerUse").answer(),
    fields("Token", "token::Token").answer(),
    fields("NewToken", "tokens::NewToken").answer(),

    // stored meshes
    fields("MeshInfo", "mesh::MeshInfo").answer().ours(&["extent: [extent_x, extent_y]"]),
    names("MeshFormat", "MeshFormat").answer(),
    fields("BoundaryInfo", "mesh::BoundaryInfo").answer(),
    fields("MeshQuality", "mesh::Quality").answer(),
];

const fn fields(message: &'static str, rust: &'static str) -> Mirror {
    mirror(Shape::Fields, message, rust)
}

const fn kinds(message: &'static str, rust: &'static str) -> Mirror {
    mirror(Shape::Kinds, message, rust)
}

const fn array(message: &'static str, rust: &'static str) -> Mirror {
    mirror(Shape::Array, message, rust)
}

const fn content(message: &'static str, rust: &'static str) -> Mirror {
    mirror(Shape::Content, message, rust)
}

const fn names(message: &'static str, rust: &'static str) -> Mirror {
    mirror(Shape::Names, message, rust)
}

const fn mirror(shape: Shape, message: &'static str, rust: &'static str) -> Mirror {
    Mirror {
        message,
        rust,
        shape,
        read: true,
        defaulted: false,
        otherwise: None,
        renamed: None,
        ours: &[],
        theirs: &[],
    }
}

impl Mirror {
    const fn answer(mut self) -> Mirror {
        self.read = false;
        self
    }

    const fn defaulted(mut self) -> Mirror {
        self.defaulted = true;
        self
    }

    const fn otherwise(mut self, field: &'static str, value: &'static str) -> Mirror {
        self.otherwise = Some((field, value));
        self
    }

    const fn renamed(mut self, field: &'static str, rust: &'static str) -> Mirror {
        self.renamed = Some((field, rust));
        self
    }

    const fn ours(mut self, patterns: &'static [&'static str]) -> Mirror {
        self.ours = patterns;
        self
    }

    const fn theirs(mut self, values: &'static [&'static str]) -> Mirror {
        self.theirs = values;
        self
    }
}
