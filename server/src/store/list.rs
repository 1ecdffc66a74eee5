//! Lists of jobs: pages, counts, keys.
//!
//! A page costs as many rows as it shows, not as many as there are. Each filter has an index in the order of
//! the list. One filter leads, and the others are checked on the rows that it finds: one that leaves few jobs,
//! which are sorted where they have to be, or else one whose index has the order of the list, since then a
//! page is soon full.

use sqlx::{QueryBuilder, Row, Sqlite, SqliteConnection};

use super::{
    database::Store,
    error::Result,
    filter::{Cursor, Filter, GroupBy, Order, OrderBy},
    rows::from_row,
};
use crate::{
    caller::Owners,
    job::{Job, Status},
};

/// What finds the rows of a list.
#[derive(Clone, Copy)]
pub(super) enum Lead<'a> {
    Label(&'a (String, String)),
    InputHash(&'a str),
    Name(&'a str),
    Status(Status),
    Owner(&'a str),
    /// The time of the end, in a list by the time of arrival.
    Ended,
    All,
}

/// A filter that leaves no more jobs than this leads whatever the order: to look at all of them, and to sort
/// them, takes less than a page may.
const FEW: i64 = 1000;

impl Store {
    /// At most `limit` jobs of a list, after `cursor`.
    pub async fn jobs(
        &self,
        owners: Owners<'_>,
        filter: &Filter,
        order: Order,
        cursor: Option<Cursor>,
        limit: i64,
    ) -> Result<Vec<Job>> {
        let Some(filter) = &filter.among(owners) else {
            return Ok(vec![]);
        };
        let mut connection = self.lists.acquire().await?;
        let leads = match few(&mut connection, filter, order).await? {
            Some(lead) => vec![lead],
            None => leads(filter, order),
        };
        let mut query = page_of_jobs(filter, &leads, order, cursor, limit);
        let rows = query.build().fetch_all(&mut *connection).await?;
        let mut jobs = rows.iter().map(from_row).collect::<Result<Vec<Job>>>()?;
        self.place(&mut connection, &mut jobs).await?;
        Ok(jobs)
    }

    /// How many jobs there are, in groups if asked for, the groups by name.
    pub async fn count(
        &self,
        owners: Owners<'_>,
        filter: &Filter,
        group_by: Option<GroupBy>,
    ) -> Result<Vec<(String, i64)>> {
        let Some(filter) = &filter.among(owners) else {
            return Ok(vec![]);
        };
        let mut query = counted(filter, group_by);
        let rows = query.build().fetch_all(&self.lists).await?;
        rows.iter()
            .map(|row| Ok((row.try_get("kind")?, row.try_get("jobs")?)))
            .collect()
    }

    /// The numbers of at most `limit` jobs, in order of arrival, after one number and up to another.
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
        Ok(query.build_query_scalar().fetch_all(&self.lists).await?)
    }
}

/// At most `limit` jobs: of each lead so many, and of all of them together.
pub(super) fn page_of_jobs(
    filter: &Filter,
    leads: &[Lead<'_>],
    order: Order,
    cursor: Option<Cursor>,
    limit: i64,
) -> QueryBuilder<Sqlite> {
    let mut query = QueryBuilder::<Sqlite>::new("");
    for (n, lead) in leads.iter().enumerate() {
        query.push(if n == 0 {
            "select * from ("
        } else {
            " union all select * from ("
        });
        page(&mut query, filter, *lead, order, cursor);
        query.push(" limit ").push_bind(limit).push(")");
    }
    if leads.len() > 1 {
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

/// At most `limit` numbers of jobs, in order.
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

/// A filter that leaves few jobs, if there is one and there is a choice.
async fn few<'a>(
    connection: &mut SqliteConnection,
    filter: &'a Filter,
    order: Order,
) -> Result<Option<Lead<'a>>> {
    let mut candidates: Vec<Lead<'a>> = filter.labels.iter().map(Lead::Label).collect();
    candidates.extend(filter.input_hash.as_deref().map(Lead::InputHash));
    candidates.extend(filter.name.as_deref().map(Lead::Name));
    candidates.extend(filter.owner.as_deref().map(Lead::Owner));
    if let [status] = filter.statuses[..] {
        candidates.push(Lead::Status(status));
    }
    let by_creation = order.by == OrderBy::CreatedAt;
    if by_creation && (filter.finished_after.is_some() || filter.finished_before.is_some()) {
        candidates.push(Lead::Ended);
    }
    if by_creation && candidates.len() == 1 && !matches!(candidates[0], Lead::Ended) {
        return Ok(None);
    }
    for lead in candidates {
        let mut query = QueryBuilder::<Sqlite>::new("select count(*) from (select 1 from ");
        match lead {
            Lead::Label((key, value)) => {
                query.push("job_label where key = ").push_bind(key);
                query.push(" and value = ").push_bind(value);
            }
            Lead::InputHash(hash) => {
                query.push("job where input_hash = ").push_bind(hash);
            }
            Lead::Name(name) => {
                query.push("job where name = ").push_bind(name);
            }
            Lead::Status(status) => {
                query
                    .push("job where status = ")
                    .push_bind(<&str>::from(status));
            }
            Lead::Ended => {
                query.push("job indexed by job_by_finished where finished_at is not null");
                times(&mut query, filter, "finished_at", None);
            }
            Lead::Owner(owner) => {
                query.push("job where owner = ").push_bind(owner);
            }
            Lead::All => continue,
        }
        query.push(" limit ").push_bind(FEW + 1).push(")");
        let jobs: i64 = query
            .build_query_scalar()
            .fetch_one(&mut *connection)
            .await?;
        if jobs <= FEW {
            return Ok(Some(lead));
        }
    }
    Ok(None)
}

/// What leads where every filter leaves many jobs: an index in the order of the list. One lead, or where only
/// statuses can one for each of them, since their lists are merged.
pub(super) fn leads(filter: &Filter, order: Order) -> Vec<Lead<'_>> {
    let statuses = &filter.statuses;
    let by_status: Vec<Lead<'_>> = statuses.iter().copied().map(Lead::Status).collect();
    let owner_or_all = filter.owner.as_deref().map_or(Lead::All, Lead::Owner);
    // most jobs succeed: of the others there are fewer than most filters leave
    let of_the_others = !by_status.is_empty() && !statuses.contains(&Status::Succeeded);
    if order.by == OrderBy::FinishedAt || of_the_others {
        return match by_status.is_empty() {
            true => vec![owner_or_all],
            false => by_status,
        };
    }
    if let Some(label) = filter.labels.first() {
        return vec![Lead::Label(label)];
    }
    if let Some(hash) = &filter.input_hash {
        return vec![Lead::InputHash(hash)];
    }
    if let Some(name) = &filter.name {
        return vec![Lead::Name(name)];
    }
    if !by_status.is_empty() {
        return by_status;
    }
    vec![owner_or_all]
}

/// One ordered list without its limit.
fn page(
    query: &mut QueryBuilder<Sqlite>,
    filter: &Filter,
    lead: Lead<'_>,
    order: Order,
    cursor: Option<Cursor>,
) {
    let by_creation = order.by == OrderBy::CreatedAt;
    // `indexed by`: the planner knows nothing of how many jobs a filter leaves, and would guess
    match lead {
        Lead::Label((key, value)) => {
            query.push("select job.* from job_label cross join job on job.id = job_label.job_id where job_label.key = ");
            query.push_bind(key.clone());
            query.push(" and job_label.value = ");
            query.push_bind(value.clone());
        }
        Lead::InputHash(hash) => {
            query.push("select * from job indexed by job_by_input where input_hash = ");
            query.push_bind(hash.to_owned());
        }
        Lead::Name(name) => {
            query.push("select * from job indexed by job_by_name where name = ");
            query.push_bind(name.to_owned());
        }
        Lead::Status(status) => {
            let index = if by_creation {
                "job_by_status"
            } else {
                "job_by_status_finished"
            };
            query.push(format!(
                "select * from job indexed by {index} where status = "
            ));
            query.push_bind(<&str>::from(status));
        }
        Lead::Owner(owner) => {
            let index = if by_creation {
                "job_by_owner"
            } else {
                "job_by_owner_finished"
            };
            query.push(format!(
                "select * from job indexed by {index} where owner = "
            ));
            query.push_bind(owner.to_owned());
        }
        Lead::Ended => {
            query
                .push("select * from job indexed by job_by_finished where finished_at is not null");
        }
        Lead::All => {
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
    conditions(query, filter, Some(lead));
    let (by, id) = match lead {
        Lead::Label(_) if by_creation => ("job_label.created_at", "job_label.job_id"),
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

/// All conditions of a filter but for times. The one that leads is said twice, which costs nothing, but for
/// statuses, of which each leads a list of its own, and labels, which are rows elsewhere.
fn conditions(query: &mut QueryBuilder<Sqlite>, filter: &Filter, lead: Option<Lead<'_>>) {
    let Filter {
        statuses,
        owner,
        labels,
        name,
        input_hash,
        ..
    } = filter;
    if !statuses.is_empty() && !matches!(lead, Some(Lead::Status(_))) {
        query.push(" and job.status in (");
        let mut list = query.separated(", ");
        statuses.iter().for_each(|status| {
            list.push_bind(<&str>::from(*status));
        });
        query.push(")");
    }
    for label in labels {
        let (key, value) = label;
        match lead {
            Some(Lead::Label(leading)) if leading == label => continue,
            // one look for each row that the lead finds
            Some(_) => query.push(
                " and exists (select 1 from job_label where created_at = job.created_at and job_id = job.id and key = ",
            ),
            None => query.push(" and job.id in (select job_id from job_label where key = "),
        };
        query.push_bind(key.clone()).push(" and value = ");
        query.push_bind(value.clone()).push(")");
    }
    let texts = [("owner", owner), ("name", name), ("input_hash", input_hash)];
    for (column, text) in texts {
        if let Some(text) = text {
            query.push(format!(" and job.{column} = "));
            query.push_bind(text.clone());
        }
    }
}

/// The bounds of both times. `by` is the column that orders the list; what a cursor in this order says of it
/// is not said again, since the index would start from either.
fn times(query: &mut QueryBuilder<Sqlite>, filter: &Filter, by: &str, cursor: Option<Order>) {
    let (mut created_before, mut finished_after) = (filter.created_before, filter.finished_after);
    let by_creation = by.ends_with("created_at");
    // Nobody ends before it was accepted: a bound on one time is one on the other, by which the list is read.
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
        let said = cursor.is_some_and(|order| order.descending == (comparison == "<"));
        if let Some(time) = time
            && !(said && column == by)
        {
            query.push(format!(" and {column} {comparison} "));
            query.push_bind(time.micros());
        }
    }
}
