//! Lists of jobs: pages, counts, keys.
//!
//! A page costs as many rows as it shows, not as many as the table has. Each filter has an index in the order of
//! the list, and those by label, status and name have another one that begins with the owner: most callers see
//! only their own jobs, however many others have the same. One filter is chosen as the access path, and the
//! others are checked on the rows that it finds: a filter that matches few jobs, which are then sorted if
//! necessary, or else one whose index has the order of the list, since then a page is soon full.

use futures_util::TryStreamExt;
use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

use super::{
    damage::Table,
    database::Store,
    entries::{Entries, bytes_of},
    error::Result,
    filter::{Cursor, Filter, GroupBy, Order, OrderBy},
    rows::from_row,
};
use crate::{
    caller::Owners,
    job::{Job, Status, SweepId},
};

/// The index by which the rows of a list are found.
#[derive(Clone, Copy)]
pub(super) enum AccessPath<'a> {
    Label(&'a (String, String)),
    InputHash(&'a str),
    Sweep(SweepId),
    Name(&'a str),
    Status(Status),
    Owner(&'a str),
    /// By the time of the end, in a list ordered by the time of arrival.
    Ended,
    All,
}

/// A filter that matches no more jobs than this is the access path, whatever the order of the list: to read and sort
/// all of them costs less than a page may.
const FEW: i64 = 1000;
/// Matches are counted up to so many, which takes a millisecond or two: of several filters that match more than a few, the first
/// one within this is the access path, or one with a tenth of its matches, since a page may have to pass over all of them.
const MANY: i64 = 20_000;
/// The statuses of jobs that have ended.
const ENDED: [Status; 3] = [Status::Succeeded, Status::Failed, Status::Canceled];

impl Store {
    /// At most `limit` jobs of a list, after `cursor`.
    #[cfg(test)]
    pub async fn jobs(
        &self,
        owners: Owners<'_>,
        filter: &Filter,
        order: Order,
        cursor: Option<Cursor>,
        limit: i64,
    ) -> Result<Vec<Job>> {
        let found = self.some_jobs(owners, filter, order, cursor, limit).await?;
        Ok(found.items)
    }

    /// At most `limit` jobs of a list, after `cursor`; fewer if their labels are large.
    pub async fn some_jobs(
        &self,
        owners: Owners<'_>,
        filter: &Filter,
        order: Order,
        cursor: Option<Cursor>,
        limit: i64,
    ) -> Result<Entries<Job>> {
        let Some(filter) = &filter.among(owners) else {
            return Ok(Entries::default());
        };
        let read = async {
            let mut connection = self.lists.acquire().await?;
            let paths = match selective_path(&mut connection, filter, order).await? {
                Some(path) => vec![path],
                None => ordered_paths(filter, order),
            };
            let mut query = page_of_jobs(filter, &paths, order, cursor, limit);
            let mut jobs = Entries::default();
            let mut rows = query.build().fetch(&mut *connection);
            while let Some(row) = rows.try_next().await? {
                let job = from_row(&row)?;
                let bytes = bytes_of(&job.labels);
                if jobs.add(job, bytes).is_break() {
                    break;
                }
            }
            drop(rows);
            self.complete(&mut connection, &mut jobs.items).await?;
            self.damages.have_all(tables_of(filter))?;
            Ok(jobs)
        };
        self.damages.noting(read).await
    }

    /// How many jobs there are, by group if requested; the groups are sorted by name.
    pub async fn count(
        &self,
        owners: Owners<'_>,
        filter: &Filter,
        group_by: Option<GroupBy>,
    ) -> Result<Vec<(String, i64)>> {
        let Some(filter) = &filter.among(owners) else {
            return Ok(vec![]);
        };
        let read = async {
            let mut query = counted(filter, group_by);
            let rows = query.build().fetch_all(&self.lists).await?;
            self.damages.have_all(tables_of(filter))?;
            rows.iter()
                .map(|row| Ok((row.try_get("kind")?, row.try_get("jobs")?)))
                .collect()
        };
        self.damages.noting(read).await
    }

    /// The keys of at most `limit` jobs, in order of arrival, after one key and up to another.
    pub async fn keys(
        &self,
        owners: Owners<'_>,
        filter: &Filter,
        after: i64,
        up_to: i64,
        limit: i64,
    ) -> Result<Vec<i64>> {
        let Some(filter) = &filter.among(owners) else {
            return Ok(vec![]);
        };
        let mut query = keys_of_jobs(filter, after, up_to, limit);
        let keys = query.build_query_scalar().fetch_all(&self.lists).await?;
        self.damages.have_all(tables_of(filter))?;
        Ok(keys)
    }
}

/// Where jobs are found by this filter.
fn tables_of(filter: &Filter) -> &'static [Table] {
    match filter.labels.is_empty() {
        true => &[Table::Jobs],
        false => &[Table::Jobs, Table::Labels],
    }
}

/// At most `limit` jobs, from the lists of all access paths merged.
pub(super) fn page_of_jobs(
    filter: &Filter,
    paths: &[AccessPath<'_>],
    order: Order,
    cursor: Option<Cursor>,
    limit: i64,
) -> QueryBuilder<Sqlite> {
    let mut query = QueryBuilder::<Sqlite>::new("");
    for (n, path) in paths.iter().enumerate() {
        query.push(if n == 0 {
            "select * from ("
        } else {
            " union all select * from ("
        });
        page(&mut query, filter, *path, order, cursor);
        query.push(" limit ").push_bind(limit).push(")");
    }
    if paths.len() > 1 {
        let (by, direction) = (<&str>::from(order.by), order.direction());
        query.push(format!(" order by {by} {direction}, id {direction} limit "));
        query.push_bind(limit);
    }
    query
}

/// The number of jobs in each group.
pub(super) fn counted(filter: &Filter, group_by: Option<GroupBy>) -> QueryBuilder<Sqlite> {
    let group = group_by.map_or("''", Into::into);
    let mut query = QueryBuilder::<Sqlite>::new(format!(
        "select {group} as kind, count(*) as jobs from job where true"
    ));
    conditions(&mut query, filter, None);
    times(&mut query, filter, "job.created_at", None);
    query.push(" group by kind order by kind");
    query
}

/// The keys of at most `limit` jobs, in order.
pub(super) fn keys_of_jobs(
    filter: &Filter,
    after: i64,
    up_to: i64,
    limit: i64,
) -> QueryBuilder<Sqlite> {
    let mut query = QueryBuilder::<Sqlite>::new("select id from job where id > ");
    query.push_bind(after).push(" and id <= ").push_bind(up_to);
    conditions(&mut query, filter, None);
    times(&mut query, filter, "job.created_at", None);
    query.push(" order by id limit ").push_bind(limit);
    query
}

/// The access path by a filter that matches few jobs, or the fewest, if there is such a filter and more than one path.
async fn selective_path<'a>(
    connection: &mut SqliteConnection,
    filter: &'a Filter,
    order: Order,
) -> Result<Option<AccessPath<'a>>> {
    let mut candidates: Vec<AccessPath<'a>> = filter.labels.iter().map(AccessPath::Label).collect();
    candidates.extend(filter.input_hash.as_deref().map(AccessPath::InputHash));
    candidates.extend(filter.sweep.map(AccessPath::Sweep));
    candidates.extend(filter.name.as_deref().map(AccessPath::Name));
    // the other indexes begin with the owner, and a sweep has one only
    if filter.input_hash.is_some() {
        candidates.extend(filter.owner.as_deref().map(AccessPath::Owner));
    }
    if let [status] = filter.statuses[..] {
        candidates.push(AccessPath::Status(status));
    }
    let by_creation = order.by == OrderBy::CreatedAt;
    if by_creation && (filter.finished_after.is_some() || filter.finished_before.is_some()) {
        candidates.push(AccessPath::Ended);
    }
    if by_creation && candidates.len() == 1 && !matches!(candidates[0], AccessPath::Ended) {
        return Ok(None);
    }
    let mut counted = if by_creation { MANY } else { FEW };
    let mut fewest = None;
    for path in candidates {
        let mut query = QueryBuilder::<Sqlite>::new("select count(*) from (select 1 from ");
        match path {
            AccessPath::Label((key, value)) => {
                query.push("job_label where key = ").push_bind(key);
                query.push(" and value = ").push_bind(value);
            }
            AccessPath::InputHash(hash) => {
                query.push("job where input_hash = ").push_bind(hash);
            }
            AccessPath::Sweep(sweep) => {
                let uuid = sweep.0.to_string();
                query.push("job where sweep = ").push_bind(uuid);
            }
            AccessPath::Name(name) => {
                query.push("job where name = ").push_bind(name);
            }
            AccessPath::Status(status) => {
                query
                    .push("job where status = ")
                    .push_bind(<&str>::from(status));
            }
            AccessPath::Ended => {
                query.push("job indexed by job_by_finished where finished_at is not null");
                times(&mut query, filter, "finished_at", None);
            }
            AccessPath::Owner(owner) => {
                query.push("job where owner = ").push_bind(owner);
            }
            AccessPath::All => continue,
        }
        let owner_is_in_index = matches!(
            path,
            AccessPath::Label(_) | AccessPath::Name(_) | AccessPath::Status(_)
        );
        if owner_is_in_index && let Some(owner) = &filter.owner {
            query.push(" and owner = ").push_bind(owner);
        }
        query.push(" limit ").push_bind(counted + 1).push(")");
        let jobs: i64 = query
            .build_query_scalar()
            .fetch_one(&mut *connection)
            .await?;
        if jobs <= FEW {
            return Ok(Some(path));
        }
        // the others have the order of the list
        let ordered = by_creation && !matches!(path, AccessPath::Ended);
        if ordered && jobs <= counted {
            fewest = Some(path);
            // to count costs time, too: another one only matters if it matches many times fewer
            counted = (jobs / 10).max(FEW);
        }
    }
    Ok(fewest)
}

/// The access path if every filter matches many jobs: an index in the order of the list. It is one path, or one
/// for each status, whose lists are merged.
pub(super) fn ordered_paths(filter: &Filter, order: Order) -> Vec<AccessPath<'_>> {
    let mut statuses = &filter.statuses[..];
    if statuses.is_empty() && order.by == OrderBy::FinishedAt && filter.owner.is_some() {
        statuses = &ENDED; // an owner's jobs are in this order by status
    }
    let by_status: Vec<AccessPath<'_>> = statuses.iter().copied().map(AccessPath::Status).collect();
    let owner_or_all = filter
        .owner
        .as_deref()
        .map_or(AccessPath::All, AccessPath::Owner);
    // most jobs succeed: of the other statuses there are fewer jobs than most filters match
    let of_the_others = !by_status.is_empty() && !statuses.contains(&Status::Succeeded);
    if order.by == OrderBy::FinishedAt || of_the_others {
        return match by_status.is_empty() {
            true => vec![owner_or_all],
            false => by_status,
        };
    }
    if let Some(label) = filter.labels.first() {
        return vec![AccessPath::Label(label)];
    }
    if let Some(sweep) = filter.sweep {
        return vec![AccessPath::Sweep(sweep)];
    }
    if let Some(hash) = &filter.input_hash {
        return vec![AccessPath::InputHash(hash)];
    }
    if let Some(name) = &filter.name {
        return vec![AccessPath::Name(name)];
    }
    if !by_status.is_empty() {
        return by_status;
    }
    vec![owner_or_all]
}

/// The list of one access path, in order and without its limit.
fn page(
    query: &mut QueryBuilder<Sqlite>,
    filter: &Filter,
    path: AccessPath<'_>,
    order: Order,
    cursor: Option<Cursor>,
) {
    let by_creation = order.by == OrderBy::CreatedAt;
    let of_one_owner = filter.owner.is_some();
    // `indexed by`: the planner does not know how many jobs a filter matches, and would guess
    match path {
        AccessPath::Label((key, value)) => {
            query.push("select job.* from job_label cross join job on job.id = job_label.job_id where job_label.key = ");
            query.push_bind(key.clone());
            query.push(" and job_label.value = ");
            query.push_bind(value.clone());
            if let Some(owner) = &filter.owner {
                query
                    .push(" and job_label.owner = ")
                    .push_bind(owner.clone());
            }
        }
        AccessPath::InputHash(hash) => {
            query.push("select * from job indexed by job_by_input where input_hash = ");
            query.push_bind(hash.to_owned());
        }
        AccessPath::Sweep(sweep) => {
            query.push("select * from job indexed by job_by_sweep where sweep = ");
            query.push_bind(sweep.0.to_string());
        }
        AccessPath::Name(name) => {
            let index = match of_one_owner {
                true => "job_by_owner_name",
                false => "job_by_name",
            };
            query.push(format!(
                "select * from job indexed by {index} where name = "
            ));
            query.push_bind(name.to_owned());
        }
        AccessPath::Status(status) => {
            let index = match (of_one_owner, by_creation) {
                (true, true) => "job_by_owner_status",
                (true, false) => "job_by_owner_status_finished",
                (false, true) => "job_by_status",
                (false, false) => "job_by_status_finished",
            };
            query.push(format!(
                "select * from job indexed by {index} where status = "
            ));
            query.push_bind(<&str>::from(status));
        }
        AccessPath::Owner(owner) => {
            query.push("select * from job indexed by job_by_owner where owner = ");
            query.push_bind(owner.to_owned());
        }
        AccessPath::Ended => {
            query
                .push("select * from job indexed by job_by_finished where finished_at is not null");
        }
        AccessPath::All => {
            let index = if by_creation {
                "job_by_created"
            } else {
                "job_by_finished"
            };
            query.push(format!("select * from job indexed by {index} where true"));
        }
    }
    if order.by == OrderBy::FinishedAt {
        query.push(" and job.finished_at is not null");
    }
    conditions(query, filter, Some(path));
    let (by, id) = match path {
        AccessPath::Label(_) if by_creation => ("job_label.created_at", "job_label.job_id"),
        _ if by_creation => ("job.created_at", "job.id"),
        _ => ("job.finished_at", "job.id"),
    };
    times(query, filter, by, cursor.map(|_| order));
    if let Some(Cursor { micros, key }) = cursor {
        let beyond = if order.descending { "<" } else { ">" };
        query.push(format!(" and ({by}, {id}) {beyond} ("));
        query.push_bind(micros).push(", ").push_bind(key).push(")");
    }
    let direction = order.direction();
    query.push(format!(" order by {by} {direction}, {id} {direction}"));
}

/// The conditions of a filter except for times. The condition of the access path is repeated, which costs nothing,
/// unless it is a status, of which each has a list of its own, or a label, which is in another table.
fn conditions(query: &mut QueryBuilder<Sqlite>, filter: &Filter, path: Option<AccessPath<'_>>) {
    let Filter {
        statuses,
        owner,
        labels,
        name,
        input_hash,
        sweep,
        ..
    } = filter;
    let sweep = sweep.map(|sweep| sweep.0.to_string());
    if !statuses.is_empty() && !matches!(path, Some(AccessPath::Status(_))) {
        query.push(" and job.status in (");
        let mut list = query.separated(", ");
        statuses.iter().for_each(|status| {
            list.push_bind(<&str>::from(*status));
        });
        query.push(")");
    }
    for label in labels {
        let (key, value) = label;
        match path {
            Some(AccessPath::Label(leading)) if leading == label => continue,
            // one lookup for each row of the access path
            Some(_) => query.push(
                " and exists (select 1 from job_label where created_at = job.created_at and job_id = job.id and key = ",
            ),
            None => query.push(" and job.id in (select job_id from job_label where key = "),
        };
        query.push_bind(key.clone()).push(" and value = ");
        query.push_bind(value.clone());
        if let (None, Some(owner)) = (path, owner) {
            query.push(" and owner = ").push_bind(owner.clone());
        }
        query.push(")");
    }
    let texts = [
        ("owner", owner),
        ("name", name),
        ("input_hash", input_hash),
        ("sweep", &sweep),
    ];
    for (column, text) in texts {
        if let Some(text) = text {
            query.push(format!(" and job.{column} = "));
            query.push_bind(text.clone());
        }
    }
}

/// The bounds of both times. `by` is the column that orders the list; a bound that a cursor in this order implies is
/// left out, since the index would start from the weaker one as well.
fn times(query: &mut QueryBuilder<Sqlite>, filter: &Filter, by: &str, cursor: Option<Order>) {
    let (mut created_before, mut finished_after) = (filter.created_before, filter.finished_after);
    let by_creation = by.ends_with("created_at");
    // No job ends before it was accepted: a bound on one time is also one on the other, by which the list is read.
    if by_creation {
        let bounds = [created_before, filter.finished_before];
        created_before = bounds.into_iter().flatten().min();
    } else {
        finished_after = finished_after.max(filter.created_after);
    }
    let created = if by_creation { by } else { "job.created_at" };
    for (column, comparison, time) in [
        (created, ">=", filter.created_after),
        (created, "<", created_before),
        ("job.finished_at", ">=", finished_after),
        ("job.finished_at", "<", filter.finished_before),
    ] {
        let implied = cursor.is_some_and(|order| order.descending == (comparison == "<"));
        if let Some(time) = time
            && !(implied && column == by)
        {
            query.push(format!(" and {column} {comparison} "));
            query.push_bind(time.micros());
        }
    }
}
