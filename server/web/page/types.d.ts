// Written by tests/page/api_types.py from the description of the API; do not edit.

export type Accuracy = {
  "quantities": (EstimatedQuantity)[];
  "reasons": (string)[];
  "verdict": (Verdict);
  "verified"?: (boolean) | null;
};

export type AccuracyMode = "estimate" | "verify";

export type AdaptiveRefine = {
  "tolerance": number;
};

export type Against = {
  "boundary": string;
};

export type Algorithm = "auto" | "fixed_point" | "newton" | "thesis";

export type Along = "x" | "arc_length";

export type Analysis = ({
  "kind": "plane_strain";
}) | ({
  "kind": "plane_stress";
  "thickness": number;
}) | ({
  "kind": "axisymmetric";
});

export type Assessment = {
  "findings": (Finding)[];
  "sentence": string;
  "verdict": (Verdict);
};

export type Axis = {
  "linspace"?: ((Spaced)) | null;
  "logspace"?: ((Spaced)) | null;
  "path": string;
  "values"?: ((unknown)[]) | null;
};

export type BareProblem = {
  "problem": Problem;
};

export type Batch = {
  "jobs": (Job)[];
};

export type BodyCache = {
  "bodies": number;
  "bytes": number;
  "evictions": number;
  "hits": number;
  "misses": number;
};

export type BodyGap = {
  "clearance"?: (number) | null;
  "interference"?: (number) | null;
};

export type BoundTable = {
  "bound": (number)[];
  "s": (number)[];
};

export type BoundaryInfo = {
  "edges": number;
  "length": number;
};

export type BoundaryPart = {
  "angle"?: (number) | null;
  "box"?: (((number)[])[]) | null;
  "normal"?: ((number)[]) | null;
  "side"?: (string) | null;
  "x"?: ((number)[]) | null;
  "y"?: ((number)[]) | null;
};

export type BoundaryValue = (number) | ((number)[]);

export type Cache = "use" | "refresh" | "off";

export type Canceled = {
  "job": Job;
  "outcome": Cancellation;
};

export type Cancellation = "canceled" | "cancel_requested" | "already_terminal";

export type Comparison = {
  "agrees": boolean;
  "change": number;
  "converged": boolean;
  "friction_force": number;
  "normal_force": number;
  "tangential_force": number;
};

export type Condition = "unilateral" | "bonded" | "none";

export type Contact = {
  "about"?: ((number)[]) | null;
  "against"?: ((Against)) | null;
  "boundary": string;
  "condition"?: (Condition);
  "direction"?: ((number)[]) | null;
  "friction"?: ((Friction)) | null;
  "gap"?: ((BodyGap)) | null;
  "indentation"?: number;
  "moment"?: (number) | null;
  "normal"?: ((NormalOf)) | null;
  "normal_force"?: (number) | null;
  "obstacle"?: ((Obstacle)) | null;
  "stiffness"?: ((ObstacleStiffness)) | null;
  "tangential_displacement"?: number;
  "tangential_force"?: (number) | null;
  "tilt"?: (number) | null;
};

export type ContactCount = {
  "active": number;
  "entered": number;
  "left": number;
};

export type ContactProfile = {
  "friction_bound": (number)[];
  "friction_ratio": (number)[];
  "gap": (number)[];
  "nonlocal_pressure": (number)[];
  "normal_displacement": (number)[];
  "normal_stress": (number)[];
  "s": (number)[];
  "state": (NodeState)[];
  "tangential_displacement": (number)[];
  "tangential_stress": (number)[];
  "x": (number)[];
  "y": (number)[];
};

export type ContactSummary = {
  "contact": ((number)[])[];
  "force"?: ((number)[]) | null;
  "friction_force": number;
  "indentation"?: (number) | null;
  "moment"?: (number) | null;
  "normal": (NormalOf);
  "normal_force": number;
  "peak_normal_stress": ((Peak)) | null;
  "peak_tangential_stress": ((Peak)) | null;
  "slip": ((number)[])[];
  "stick": ((number)[])[];
  "tangential_displacement"?: (number) | null;
  "tangential_force": number;
  "tilt"?: (number) | null;
};

export type Converted = {
  "problem": Problem;
  "warnings": (Warning)[];
};

export type Count = {
  "groups": Record<string, number>;
  "total": number;
};

export type Curve = {
  "center"?: ((number)[]) | null;
  "kind": (CurveKind);
  "radius"?: (number) | null;
};

export type CurveKind = "circle" | "spline";

export type Description = {
  "description": string;
};

export type Disk = {
  "free_bytes": number;
  "unused_bytes": number;
  "used_bytes": number;
};

export type Edits = {
  "labels"?: (Record<string, string>) | null;
  "name"?: (string) | null;
  "pinned"?: (boolean) | null;
  "priority"?: (number) | null;
};

export type Element = (number)[];

export type ElementRange = {
  "x"?: ((number)[]) | null;
  "y"?: ((number)[]) | null;
};

export type Error = {
  "code": string;
  "detail": string;
  "errors": (Violation)[];
  "instance": string;
  "retryable": boolean;
  "status": number;
  "title": string;
  "type": string;
};

export type ErrorMethod = "weighted_recovery" | "node_spacing" | "mesh_halved" | "no_limit" | "too_many" | "unknown";

export type Estimate = {
  "dofs": number;
  "memory_bytes": number;
  "run_s": number;
};

export type EstimatedQuantity = {
  "contact": string;
  "difference"?: (number) | null;
  "direction"?: (number) | null;
  "error": (number) | null;
  "finer"?: (number) | null;
  "increments"?: (number) | null;
  "measurement"?: (number) | null;
  "method": (ErrorMethod);
  "order"?: (number) | null;
  "quantity": (QuantityName);
  "relative": (number) | null;
  "value": number;
};

export type Event = ({
  "reason"?: (string) | null;
  "status": (Status);
  "type": "status";
}) | ({
  "stage": (Phase);
  "type": "stage";
}) | ({
  "elements": number;
  "error"?: (number) | null;
  "number": number;
  "type": "mesh";
}) | (Iteration) | (Warning) | ({
  "job": Job;
  "type": "done";
});

export type Example = {
  "description": string;
  "name": string;
  "problem": Problem;
  "title": string;
};

export type Examples = {
  "examples": (Example)[];
};

export type Failure = {
  "code": string;
  "detail": string;
  "title": string;
  "type": string;
};

export type Fields = {
  "contact_state": (number)[];
  "element_error": (number)[];
  "elements": (Element)[];
  "gauss": GaussFields;
  "stress_xx": (number)[];
  "stress_xy": (number)[];
  "stress_yy": (number)[];
  "stress_zz": (number)[];
  "ux": (number)[];
  "uy": (number)[];
  "x": (number)[];
  "y": (number)[];
};

export type Finding = {
  "code": (FindingCode);
  "contact": (string) | null;
  "quantity": ((QuantityName)) | null;
  "text": string;
  "verdict": (Verdict);
  "warning": ((WarningCode)) | null;
};

export type FindingCode = "not_converged" | "false_convergence" | "no_limit" | "too_many_ends" | "large_error" | "unknown_error" | "warning";

export type ForcePair = {
  "normal": number;
  "tangential": number;
};

export type Forecast = {
  "last_hour": (LoadPoint)[];
  "waiting": (WaitingJob)[];
};

export type Friction = {
  "bound"?: ((PrescribedBound)) | null;
  "coefficient"?: (number) | null;
  "cohesion"?: number;
  "elastic_slip": number;
  "history"?: (History);
  "kernel"?: (Kernel);
  "measure"?: (Measure);
  "nonlocal_radius"?: (number) | null;
  "normalization"?: (Normalization);
  "points"?: (FrictionPoints);
  "shear_cap"?: (number) | null;
  "transition"?: (Transition);
};

export type FrictionCount = {
  "slip": number;
  "stick": number;
};

export type FrictionPoints = "gauss3" | "nodal";

export type GaussFields = {
  "order": number;
  "stress_xx": (number)[];
  "stress_xy": (number)[];
  "stress_yy": (number)[];
  "stress_zz": (number)[];
  "x": (number)[];
  "y": (number)[];
};

export type Grid = {
  "bottom"?: (((number)[])[]) | null;
  "top"?: (((number)[])[]) | null;
  "x": (number)[];
  "y": (number)[];
};

export type History = "total" | "incremental";

export type HistoryRow = {
  "contact": ContactCount;
  "contraction": (number) | null;
  "force": ForcePair;
  "friction": FrictionCount;
  "friction_residual": number;
  "increment": number;
  "inner": number;
  "k": number;
  "motion"?: ((ObstacleMotion)) | null;
  "r_f": (number) | null;
  "residual": number;
  "seq"?: (number) | null;
  "stage": (Stage);
  "step": number;
  "tolerance": number;
  "wall_s": number;
};

export type Info = {
  "api_version": string;
  "body_cache": BodyCache;
  "disk": Disk;
  "field_formats": (string)[];
  "isolation": (Isolation);
  "limits": ServiceLimits;
  "name": string;
  "retention": Retention;
  "table_formats": (string)[];
  "version": string;
  "workers": number;
};

export type InlineMesh = {
  "boundaries"?: Record<string, ((number)[])[]>;
  "elements": (Element)[];
  "groups"?: Record<string, (number)[]>;
  "node_sets"?: Record<string, (number)[]>;
  "nodes": ((number)[])[];
  "temperatures"?: (number)[];
};

export type Interpolation = "linear" | "cubic";

export type Isolation = "thread" | "process";

export type Iteration = {
  "contact": ContactCount;
  "contraction": (number) | null;
  "force": ForcePair;
  "friction": FrictionCount;
  "friction_residual": number;
  "increment": number;
  "inner": number;
  "k": number;
  "motion"?: ((ObstacleMotion)) | null;
  "r_f": (number) | null;
  "residual": number;
  "stage": (Stage);
  "step": number;
  "tolerance": number;
  "wall_s": number;
};

export type Job = {
  "attempt": number;
  "cached_from": ((JobId)) | null;
  "cancel_requested": boolean;
  "created_at": string;
  "failure": ((Failure)) | null;
  "finished_at": (string) | null;
  "id": JobId;
  "input_hash": string;
  "labels": Record<string, string>;
  "limits": Limits;
  "links": Record<string, string>;
  "max_attempts": number;
  "name": (string) | null;
  "owner": string;
  "parent": ((JobId)) | null;
  "pinned": boolean;
  "priority": number;
  "progress": ((Progress)) | null;
  "quantities": (EstimatedQuantity)[];
  "queue": ((QueuePosition)) | null;
  "queue_wait_s": (number) | null;
  "reason": ((Reason)) | null;
  "result_available": (ResultAvailable);
  "run_s": (number) | null;
  "started_at": (string) | null;
  "status": (Status);
  "stored_bytes": (number) | null;
  "sweep": ((SweepId)) | null;
  "verdict": ((Verdict)) | null;
  "version": number;
  "warnings": (Warning)[];
};

export type JobId = string;

export type JobList = {
  "jobs": (Job)[];
  "next_page_token": (string) | null;
};

export type JobTable = {
  "columns": (string)[];
  "next_page_token": (string) | null;
  "rows": (Record<string, unknown>)[];
};

export type Kept = {
  "limit": (number) | null;
  "used": number;
};

export type Kernel = "bump" | "parabola";

export type Kind = {
  "code": string;
  "explanation": string;
  "grpc": (string) | null;
  "retry_after_s": (number) | null;
  "status": (number) | null;
  "title": string;
};

export type Limits = {
  "queue_ttl_s"?: number;
  "timeout_s"?: number;
};

export type ListPayload = ({
  "type": "reset";
}) | ({
  "job": Job;
  "type": "job";
}) | ({
  "id": JobId;
  "type": "removed";
}) | ({
  "sweep": Sweep;
  "type": "sweep";
}) | ({
  "counts": Count;
  "type": "counts";
}) | ({
  "queue": QueueState;
  "type": "queue";
});

export type Load = {
  "body_force"?: ((number)[]) | null;
  "boundary"?: (string) | null;
  "force"?: ((number)[]) | null;
  "gravity"?: ((number)[]) | null;
  "group"?: (string) | null;
  "nodal"?: (((number)[])[]) | null;
  "nodal_temperature"?: (number) | null;
  "nodes"?: (string) | null;
  "normal"?: ((BoundaryValue)) | null;
  "pressure"?: ((BoundaryValue)) | null;
  "rotation"?: ((Rotation)) | null;
  "tangential"?: ((BoundaryValue)) | null;
  "temperature"?: (number) | null;
  "traction"?: ((BoundaryValue)[]) | null;
};

export type LoadPoint = {
  "queued": number;
  "running": number;
  "t": string;
};

export type LogIn = {
  "token": string;
};

export type Many = {
  "changed": number;
  "matched": number;
};

export type Material = {
  "density"?: (number) | null;
  "expansion"?: (number) | null;
  "group"?: (string) | null;
  "name"?: (string) | null;
  "orthotropic"?: ((Orthotropic)) | null;
  "poissons_ratio"?: (number) | null;
  "youngs_modulus"?: (number) | null;
};

export type Me = {
  "owner": string;
  "queued": Share;
  "running": Share;
  "scopes": (Scope)[];
  "stored_bytes": Kept;
  "submissions"?: ((Rate)) | null;
};

export type Measure = "line" | "surface";

export type MemberCounts = {
  "canceled": number;
  "failed": number;
  "queued": number;
  "running": number;
  "succeeded": number;
  "total": number;
};

export type MemberRow = {
  "contact_width": (number) | null;
  "contact_width_error": (number) | null;
  "detail"?: (string) | null;
  "friction_force": (number) | null;
  "iterations": number;
  "normal_force": (number) | null;
  "number": number;
  "obstacle_indentation"?: (number) | null;
  "obstacle_tangential_displacement"?: (number) | null;
  "obstacle_tilt"?: (number) | null;
  "parameters": Record<string, unknown>;
  "peak_normal_stress": (number) | null;
  "peak_tangential_stress": (number) | null;
  "reason": ((Reason)) | null;
  "residuals": ((Residuals)) | null;
  "slip_width": (number) | null;
  "status": (Status);
  "stick_width": (number) | null;
  "tangential_force": (number) | null;
  "verdict": ((Verdict)) | null;
  "violations"?: (Violation)[];
  "warnings": (WarningCode)[];
};

export type MergePatch = {
  "labels"?: (Record<string, (string) | null>) | null;
  "name"?: (string) | null;
  "pinned"?: (boolean) | null;
  "priority"?: (number) | null;
};

export type MeshFormat = "gmsh" | "abaqus" | "json";

export type MeshInfo = {
  "boundaries": Record<string, BoundaryInfo>;
  "bytes": number;
  "created_at": string;
  "dofs": number;
  "extent": ((number)[])[];
  "format": (MeshFormat);
  "groups": Record<string, number>;
  "hash": string;
  "node_sets": Record<string, number>;
  "nodes": number;
  "quadrilaterals": number;
  "quality": Quality;
  "triangles": number;
  "warnings": (Warning)[];
};

export type MeshInput = {
  "abaqus"?: (string) | null;
  "boundaries"?: Record<string, BoundaryPart>;
  "curves"?: Record<string, Curve>;
  "gmsh"?: (string) | null;
  "grid"?: ((Grid)) | null;
  "grids"?: (Record<string, Grid>) | null;
  "groups"?: Record<string, ElementRange>;
  "inline"?: ((InlineMesh)) | null;
  "refine"?: Refine;
  "stored"?: (string) | null;
};

export type MeshList = {
  "meshes": (MeshInfo)[];
  "next_page_token": (string) | null;
};

export type NewLimits = {
  "queue_ttl_s"?: (number) | null;
  "timeout_s"?: (number) | null;
};

export type NewToken = {
  "secret": string;
  "token": Token;
};

export type NodeState = "open" | "stick" | "slip";

export type NormalOf = "body" | "obstacle" | "mean";

export type Normalization = "unit_integral" | "peak_one" | "conserving";

export type Obstacle = ({
  "along"?: (Along);
  "from"?: (number) | null;
  "kind": "flat";
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "center"?: number;
  "from"?: (number) | null;
  "kind": "circle";
  "radius": number;
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "center"?: number;
  "from"?: (number) | null;
  "kind": "parabola";
  "radius": number;
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "angle": number;
  "center"?: number;
  "from"?: (number) | null;
  "kind": "wedge";
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "angle": number;
  "center"?: number;
  "from"?: (number) | null;
  "kind": "cone";
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "center"?: number;
  "from"?: (number) | null;
  "kind": "tilted";
  "slope": number;
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "center"?: number;
  "coefficient": number;
  "exponent": number;
  "from"?: (number) | null;
  "kind": "power";
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "center"?: number;
  "from"?: (number) | null;
  "half_width": number;
  "kind": "rounded_flat";
  "radius": number;
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "from"?: (number) | null;
  "gap": (number)[];
  "interpolation"?: (Interpolation);
  "kind": "table";
  "smoothing"?: ((Smoothing)) | null;
  "to"?: (number) | null;
  "x": (number)[];
}) | ({
  "along"?: (Along);
  "from"?: (number) | null;
  "interpolation"?: (Interpolation);
  "kind": "polyline";
  "points": ((number)[])[];
  "to"?: (number) | null;
}) | ({
  "along"?: (Along);
  "angle": number;
  "from"?: (number) | null;
  "kind": "line";
  "point": (number)[];
  "to"?: (number) | null;
});

export type ObstacleMotion = {
  "indentation": number;
  "tangential_displacement": number;
  "tilt": number;
};

export type ObstacleStiffness = {
  "normal"?: number;
  "rotational"?: number;
  "tangential"?: number;
};

export type Orthotropic = {
  "angle"?: number;
  "e1": number;
  "e2": number;
  "e3"?: (number) | null;
  "expansion"?: ((number)[]) | null;
  "g12": number;
  "nu12": number;
  "nu13"?: (number) | null;
  "nu23"?: (number) | null;
};

export type Outcome = "converged" | "not_converged" | "contact_cycling" | "false_convergence" | "canceled" | "unfinished";

export type OwnerUse = {
  "job_bytes": number;
  "jobs": number;
  "mesh_bytes": number;
  "owner": string;
  "queued": number;
  "running": number;
};

export type Owners = {
  "owners": (OwnerUse)[];
};

export type Peak = {
  "s": number;
  "value": number;
  "x": number;
  "y": number;
};

export type Phase = "parse" | "mesh" | "assemble" | "order" | "factor" | "condense" | "iterate" | "recover" | "verify";

export type PrescribedBound = (number) | (BoundTable);

export type Problem = {
  "analysis": Analysis;
  "contacts"?: (Contact)[];
  "loads"?: (Load)[];
  "materials": (Material)[];
  "mesh": MeshInput;
  "quadrature"?: number;
  "solver"?: SolverControls;
  "steps"?: (Step)[];
  "supports"?: (Support)[];
  "title"?: (string) | null;
  "units"?: ((Units)) | null;
};

export type Progress = {
  "contact_changes": (number) | null;
  "eta_s": (number) | null;
  "iteration": number;
  "mesh": (number) | null;
  "mesh_elements": (number) | null;
  "mesh_error": (number) | null;
  "rate": (number) | null;
  "residual": (number) | null;
  "residuals": (number)[];
  "stage": string;
  "tolerance": (number) | null;
};

export type Quality = {
  "least_jacobian_ratio": number;
  "worst_element": number;
};

export type QuantityName = "normal_force" | "tangential_force" | "friction_force" | "peak_normal_stress" | "peak_tangential_stress" | "contact_start" | "contact_end" | "stick_end" | "indentation" | "tangential_displacement" | "tilt";

export type QueuePosition = {
  "ahead": number;
  "position": number;
  "reason": (Waiting);
};

export type QueueState = {
  "idle": number;
  "max_queued": number;
  "paused": boolean;
  "queued": number;
  "running": number;
  "workers": number;
};

export type Rate = {
  "left": number;
  "per_minute": number;
};

export type Reason = "not_converged" | "contact_cycling" | "false_convergence" | "singular_system" | "non_finite" | "timed_out" | "queue_expired" | "resource_exhausted" | "worker_lost" | "invalid_problem" | "internal" | "user_cancel";

export type Reason2 = "malformed" | "wrong_type" | "unknown_name" | "unknown_alternative" | "duplicate_name" | "missing" | "wrong_count" | "wrong_length" | "too_few" | "too_many" | "too_long" | "too_large" | "not_finite" | "out_of_range" | "not_increasing" | "not_used" | "conflict" | "unknown_boundary" | "unknown_group" | "unknown_node_set" | "unknown_mesh" | "name_taken" | "truncated" | "unsupported" | "not_understood" | "unknown_node" | "unknown_element" | "unknown_edge" | "repeated_node" | "repeated_element" | "repeated_edge" | "repeated_point" | "unused_node" | "wrong_midside" | "inner_edge" | "nonconforming" | "inverted_element" | "not_plane" | "does_not_span" | "empty_boundary" | "empty_group" | "overlap" | "not_a_chain" | "turns_corner" | "not_monotonic" | "no_area" | "covers_nothing" | "shared_node" | "oblique_support" | "impossible" | "free_body";

export type Refine = (number) | (AdaptiveRefine);

export type Refinement = {
  "change": (number) | null;
  "dofs": number;
  "elements": number;
  "error"?: (number) | null;
  "friction_force": number;
  "normal_force": number;
  "peak_normal_stress": number;
  "peak_tangential_stress": number;
  "tangential_force": number;
};

export type Residuals = {
  "equilibrium": number;
  "friction": number;
  "kkt": number;
  "monolithic": number;
};

export type Result = {
  "assessment": ((Assessment)) | null;
  "result_available": (ResultAvailable);
  "steps": (StepResult)[];
  "summary": Summary;
};

export type ResultAvailable = "none" | "partial" | "final";

export type Retention = {
  "bytes": (number) | null;
  "bytes_per_owner": (number) | null;
  "days": (number) | null;
  "fields_days": (number) | null;
  "jobs": (number) | null;
  "jobs_per_owner": (number) | null;
};

export type Retry = {
  "limits"?: ((NewLimits)) | null;
  "priority"?: (number) | null;
};

export type Rotation = {
  "about"?: ((number)[]) | null;
  "angular_velocity": number;
};

export type Scope = "read" | "submit" | "cancel" | "work" | "admin";

export type ServiceLimits = {
  "body_cache_bytes": number;
  "max_batch": number;
  "max_body_bytes": number;
  "max_mesh_bytes": number;
  "max_message_bytes": number;
  "max_page_size": number;
  "max_queued": number;
  "max_wait_s": number;
  "memory_budget_bytes": number;
};

export type Session = {
  "expires_at": string;
  "owner": string;
};

export type Severity = "serious" | "warning" | "note";

export type Share = {
  "limit": number;
  "used": number;
};

export type Smoothing = {
  "standard_deviation": number;
};

export type SolutionSummary = {
  "accuracy"?: ((Accuracy)) | null;
  "contact_dofs": number;
  "contacts": Record<string, ContactSummary>;
  "contraction": (number) | null;
  "converged": boolean;
  "cut_backs": number;
  "dofs": number;
  "doubled_increments": ((Comparison)) | null;
  "energy": number;
  "friction_force": number;
  "friction_work": number;
  "increments": number;
  "iterations": number;
  "normal_force": number;
  "outcome": (Outcome);
  "refinements": (Refinement)[];
  "residuals": Residuals;
  "stage": (Stage);
  "strain_energy"?: (number) | null;
  "tangential_force": number;
  "uniqueness": ((Comparison)) | null;
  "warnings": (Warning)[];
};

export type SolverControls = {
  "accuracy"?: ((AccuracyMode)) | null;
  "algorithm"?: (Algorithm);
  "check_increments"?: boolean;
  "check_uniqueness"?: boolean;
  "max_iterations"?: number;
  "thesis"?: ((ThesisOptions)) | null;
  "tolerance"?: number;
};

export type Spaced = {
  "count": number;
  "start": number;
  "stop": number;
};

export type Spacing = "uniform" | "contact_width";

export type SpringStiffness = {
  "normal"?: number;
  "tangential"?: number;
  "x"?: number;
  "y"?: number;
};

export type Stage = "frictionless" | "bonded" | "outer" | "inner" | "newton" | "thesis";

export type Status = "queued" | "running" | "succeeded" | "failed" | "canceled";

export type Step = {
  "increments"?: number;
  "indentation"?: number;
  "loads"?: number;
  "moment"?: number;
  "name"?: (string) | null;
  "normal_force"?: number;
  "spacing"?: (Spacing);
  "supports"?: number;
  "tangential_displacement"?: number;
  "tangential_force"?: number;
  "tilt"?: number;
};

export type StepResult = {
  "name": string;
  "summary": SolutionSummary;
};

export type Submission = {
  "cache"?: ((Cache)) | null;
  "labels"?: (Record<string, string>) | null;
  "limits"?: ((Limits)) | null;
  "name"?: (string) | null;
  "priority"?: (number) | null;
  "problem": Problem;
};

export type Submissions = {
  "jobs": (Submission)[];
};

export type Summary = {
  "accuracy"?: ((Accuracy)) | null;
  "body_reused": boolean;
  "contact_dofs": number;
  "contacts": Record<string, ContactSummary>;
  "contraction": (number) | null;
  "converged": boolean;
  "cut_backs": number;
  "digest": string;
  "dofs": number;
  "doubled_increments": ((Comparison)) | null;
  "energy": number;
  "friction_force": number;
  "friction_work": number;
  "increments": number;
  "input_hash": string;
  "iterations": number;
  "normal_force": number;
  "outcome": (Outcome);
  "refinements": (Refinement)[];
  "residuals": Residuals;
  "solver_version": string;
  "stage": (Stage);
  "strain_energy"?: (number) | null;
  "tangential_force": number;
  "timings": Record<string, number>;
  "uniqueness": ((Comparison)) | null;
  "warnings": (Warning)[];
};

export type Support = {
  "boundary"?: (string) | null;
  "nodes"?: (string) | null;
  "stiffness"?: ((SpringStiffness)) | null;
  "un"?: ((BoundaryValue)) | null;
  "ut"?: ((BoundaryValue)) | null;
  "ux"?: ((BoundaryValue)) | null;
  "uy"?: ((BoundaryValue)) | null;
};

export type Sweep = {
  "created_at": string;
  "finished_at": (string) | null;
  "id": SweepId;
  "jobs": number;
  "labels": Record<string, string>;
  "links": Record<string, string>;
  "members": MemberCounts;
  "name": (string) | null;
  "owner": string;
  "paths": (string)[];
  "status": (Status);
  "version": string;
};

export type SweepEvent = ({
  "member": MemberRow;
  "type": "member";
}) | ({
  "sweep": Sweep;
  "type": "done";
});

export type SweepId = string;

export type SweepList = {
  "next_page_token": (string) | null;
  "sweeps": (Sweep)[];
};

export type SweepMode = "grid" | "zip" | "list";

export type SweepResults = {
  "members": (MemberRow)[];
  "next_page_token": (string) | null;
};

export type SweepSubmission = {
  "axes"?: ((Axis)[]) | null;
  "base": Problem;
  "labels"?: (Record<string, string>) | null;
  "limits"?: ((Limits)) | null;
  "mode"?: ((SweepMode)) | null;
  "name"?: (string) | null;
  "points"?: ((Record<string, unknown>)[]) | null;
  "priority"?: (number) | null;
};

export type ThesisOptions = {
  "contact_guess"?: Record<string, (number)[]>;
  "friction_force"?: number;
  "local_points"?: number;
  "pressure"?: (ThesisPressure);
  "relaxation"?: number;
  "signed"?: boolean;
};

export type ThesisPressure = "lumped" | "extrapolated";

export type Token = {
  "created_at": string;
  "expires_at": (string) | null;
  "id": string;
  "name": string;
  "owner": string;
  "revoked_at": (string) | null;
  "scopes": (Scope)[];
};

export type TokenFields = {
  "expires_in_s"?: (number) | null;
  "name": string;
  "owner": string;
  "scopes": (string)[];
};

export type TokenList = {
  "tokens": (Token)[];
};

export type Transition = "linear" | "tanh";

export type Units = {
  "force"?: (string) | null;
  "length"?: (string) | null;
  "stress"?: (string) | null;
};

export type Validation = {
  "description": (string) | null;
  "estimate": ((Estimate)) | null;
  "first_mesh": ((Estimate)) | null;
  "input_hash": (string) | null;
  "valid": boolean;
  "violations": (Violation)[];
  "warnings": (Warning)[];
};

export type Verdict = "good" | "fair" | "poor";

export type Violation = {
  "expected": string;
  "got": string;
  "hint": string;
  "pointer": string;
  "reason": (Reason2);
};

export type Waiting = "workers_busy" | "memory" | "no_worker_fits" | "paused" | "low_disk" | "owner_limit" | "coalesced";

export type WaitingJob = {
  "id": JobId;
  "name": (string) | null;
  "owner": string;
  "position": number;
  "reason": (Waiting);
  "starts_in_s": (number) | null;
};

export type Warning = {
  "code": (WarningCode);
  "message": string;
  "pointer": string;
  "severity": (Severity);
};

export type WarningCode = "units_disagree" | "lines_inside" | "supports_overlap" | "centre_nodes_dropped" | "elements_reversed" | "raised_to_second_order" | "rigid_elements_left_out" | "deck_differs" | "coincident_nodes" | "strip_cuts_polyline" | "obstacle_cuts_edge" | "smoothing_flattens" | "deviation_differs" | "elastic_slip_large" | "factors_small" | "never_applied" | "drag_returns" | "path_forgotten" | "lowest_point_is_zero" | "noise_undeclared" | "undulations_unseen" | "contact_turns" | "symmetry_missing" | "symmetric_drag" | "radial_drag" | "material_junction" | "coarser_side_carries_law" | "gap_differs" | "closing_counts_as_slip" | "mesh_too_coarse_for_radius" | "mesh_too_coarse_for_contact" | "no_contact" | "contact_opened" | "contact_reaches_obstacle_end" | "sharp_edge" | "friction_lost_at_end" | "obstacle_between_nodes" | "direction_is_linear" | "kink_in_contact" | "range_cuts_mesh" | "polygon_in_contact" | "polygon_too_coarse" | "normals_differ" | "total_law" | "radius_exceeds_contact" | "friction_beyond_contact" | "bound_beyond_contact" | "cohesion_jumps" | "oscillating_stick" | "slow_contraction" | "not_converged" | "rounding_limits_residual" | "false_convergence" | "contact_cycling" | "out_of_balance" | "slides_away" | "large_slip" | "large_strain" | "large_displacement" | "large_tilt" | "uniqueness_unknown" | "not_unique" | "peak_sign_unknown" | "increments_matter" | "refinement_unfinished";

export type WarningKind = {
  "advice": string;
  "code": string;
  "picture"?: (string) | null;
  "severity": (Severity);
  "title": string;
  "why": string;
};

export type WorkerState = {
  "cores": number;
  "id": string;
  "jobs": number;
  "memory_bytes": number;
  "name": string;
  "silent_s": number;
  "slots": number;
};

export type Workers = {
  "workers": (WorkerState)[];
};
