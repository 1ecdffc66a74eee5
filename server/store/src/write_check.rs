//! Checks whether a damaged database can still store a job, by writing one that is rolled back.

use base::job::{Cache, JobId, Limits, Reason, ResultAvailable};

use super::{
    database::Writer,
    end::end,
    error::Result,
    keys,
    parts::{Part, Parts},
    results,
    rules::Ending,
    submission::{NewJob, QueueLimits, RequestKey},
    submit,
};

/// No limits on waiting jobs, since the check concerns only the database.
const UNLIMITED: QueueLimits = QueueLimits {
    queued: u32::MAX,
    queued_of_owner: None,
};

impl Writer<'_> {
    /// Writes all data of a small job, from its submission to its end, and rolls them back.
    pub(super) fn write_and_roll_back(&self) -> Result<()> {
        let id = JobId::default();
        let job = NewJob {
            id: Some(id),
            name: None,
            labels: [("write_check".to_owned(), id.to_string())].into(),
            priority: 0,
            limits: Limits::default(),
            cache: Cache::Off,
            parent: None,
            sweep: None,
            title: None,
            input_hash: id.to_string(),
            problem: "{}".into(),
            mesh: None,
            memory_bytes: 0,
            payload: String::new(),
        };
        let request = RequestKey {
            key: id.to_string(),
            payload: String::new(),
        };
        let result = Parts::new(vec![Part::new("summary".into(), b"{}")]);
        let ending = Ending {
            result: ResultAvailable::Partial,
            ..Ending::failed(Reason::Internal, "")
        };
        let mut change = self.control_change()?;
        let key = submit::insert(&mut change, "", &job, UNLIMITED)?;
        keys::remember(&mut change, "", &request, &[key])?;
        let now = change.now();
        change.update(key, |row| row.start(now))?;
        results::attach(&mut change, key, &result)?;
        end(&mut change, key, &ending)
    }
}
