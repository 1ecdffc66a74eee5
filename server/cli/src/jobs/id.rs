//! The id of a job or of a sweep, as client commands take it.

use std::{fmt, str::FromStr};

use base::job::{JobId, SweepId};

/// The id of a job or of a sweep.
#[derive(Clone, Copy, Debug)]
pub(super) enum Id {
    Job(JobId),
    Sweep(SweepId),
}

impl Id {
    /// The path of the job or sweep in the service.
    pub(super) fn path(self) -> String {
        match self {
            Id::Job(id) => format!("/v1/jobs/{id}"),
            Id::Sweep(id) => format!("/v1/sweeps/{id}"),
        }
    }
}

impl FromStr for Id {
    type Err = String;

    fn from_str(text: &str) -> Result<Id, String> {
        let job = JobId::parse(text).map(Id::Job);
        let id = job.or_else(|| SweepId::parse(text).map(Id::Sweep));
        id.ok_or_else(|| {
            "expected the id of a job or of a sweep, as `signorini ls` prints them: job_… or sweep_…".into()
        })
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Id::Job(id) => id.fmt(f),
            Id::Sweep(id) => id.fmt(f),
        }
    }
}
