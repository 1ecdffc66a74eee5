//! Lists of jobs: pages, counts, keys.
//!
//! A filter has an index with the jobs of each value in order of arrival. There is also one index of all jobs in order
//! of arrival, and one in order of their ends. A page is read along one index, and the other filters are checked row by
//! row, for at most [`MOST_CHECKED`] rows: then the page is short, and the next page begins after the last row that was
//! checked. Of several indexes the one is chosen that gets furthest within this number of rows; their lengths need not
//! be known.

use std::sync::Arc;

use base::{
    caller::Owners,
    job::{Job, JobId},
};
use rusqlite::{Connection, types::Value};
use uuid::Uuid;

use super::{
    damage::Table,
    database::Store,
    entries::{Entries, bytes_of},
    error::Result,
    filter::{Comparison, Cursor, FILTERS, Field, Filter, GroupBy, Order, OrderBy},
    rows::from_row,
    sql::{Query, Sql},
};

/// The largest number of rows that are checked for a page; few in tests, so that pages are short.
const MOST_CHECKED: i64 = if cfg!(test) { 8 } else { 2000 };
/// The largest number of labels in a filter whose indexes are tried for a list.
const MOST_LABEL_PATHS: usize = 4;

/// A part of an index: the rows of one value.
#[derive(Clone, Copy)]
enum Lane<'a> {
    /// The rows of a label.
    Label(&'a (String, String)),
    /// The rows of a value of a column: the name of the index, the filter, and the value.
    Value(&'static str, &'static Field, &'a Value),
    /// All jobs, or all jobs that have ended.
    All,
}

/// A way to find the rows of a list: the lanes of one index, merged, and the time that orders their rows.
pub(super) struct Path<'a> {
    lanes: Vec<Lane<'a>>,
    by: OrderBy,
}

/// The part of a path that is read for a page.
#[derive(Clone, Copy)]
pub(super) struct Window {
    /// The row after which the window begins; `None`: the window begins with the first row.
    pub(super) after: Option<Cursor>,
    /// The last row of the window; `None`: the window ends with the list.
    pub(super) last: Option<Cursor>,
    pub(super) order: Order,
}

/// The keys of a number of jobs, in order of arrival.
#[derive(Debug)]
pub struct Keys {
    /// The keys.
    pub keys: Vec<i64>,
    /// The place after which further keys follow; `None` after the last key.
    pub next: Option<Cursor>,
}

impl Path<'_> {
    /// The path of all jobs, ordered by this time.
    fn whole(by: OrderBy) -> Self {
        let lanes = vec![Lane::All];
        Path { lanes, by }
    }

    /// The order in which the path has its rows, in the direction of this list.
    pub(super) fn order(&self, list: Order) -> Order {
        Order {
            by: self.by,
            ..list
        }
    }
}

impl Store {
    /// At most `limit` jobs of a list, after `cursor`, from as many pages as are needed.
    #[cfg(test)]
    pub async fn jobs(
        self: &Arc<Self>,
        owners: Owners,
        filter: &Filter,
        order: Order,
        mut cursor: Option<Cursor>,
        limit: i64,
    ) -> Result<Vec<Job>> {
        let mut all = vec![];
        loop {
            let rest = limit - all.len() as i64;
            let found = self.some_jobs(owners.clone(), filter, order, cursor, rest);
            let found = found.await?;
            all.extend(found.items);
            cursor = found.checked_to;
            if cursor.is_none() || all.len() as i64 >= limit {
                return Ok(all);
            }
        }
    }

    /// At most `limit` jobs of a list, after `cursor`; fewer if their labels are large or many rows had to be checked.
    pub async fn some_jobs(
        self: &Arc<Self>,
        owners: Owners,
        filter: &Filter,
        order: Order,
        cursor: Option<Cursor>,
        limit: i64,
    ) -> Result<Entries<Job>> {
        let Some(filter) = filter.among(&owners) else {
            return Ok(Entries::default());
        };
        self.read_list(move |store, connection| {
            let values = values_of(&filter);
            let (path, window) = choose(connection, &filter, &values, order, cursor)?;
            let query = page("job.*", &filter, &path, window, i64::MAX, limit);
            let mut jobs = Entries::default();
            jobs.checked_to = window.last;
            let mut statement = connection.prepare_cached(query.sql())?;
            let mut rows = statement.query(query.values())?;
            while let Some(row) = rows.next()? {
                let job = from_row(row)?;
                let bytes = bytes_of(&job.labels);
                if jobs.add(job, bytes).is_break() {
                    break;
                }
            }
            store.complete(connection, &mut jobs.items.iter_mut().collect::<Vec<_>>())?;
            store.damages.have_all(tables_of(&filter))?;
            Ok(jobs)
        })
        .await
    }

    /// The number of jobs, by group if requested; the groups are sorted by name.
    pub async fn count(
        self: &Arc<Self>,
        owners: Owners,
        filter: &Filter,
        group_by: Option<GroupBy>,
    ) -> Result<Vec<(String, i64)>> {
        let Some(filter) = filter.among(&owners) else {
            return Ok(vec![]);
        };
        self.read_list(move |store, connection| {
            let query = counted(&filter, group_by.as_ref());
            let mut groups: Vec<(String, i64)> =
                connection.rows(query.sql(), query.values(), |row| Ok(row.try_into()?))?;
            store.damages.have_all(tables_of(&filter))?;
            if group_by.is_some_and(|group| !group.is_partition()) {
                store.damages.have_all(&[Table::Labels])?;
            }
            groups.sort();
            Ok(groups)
        })
        .await
    }

    /// Those of the jobs with these keys that a filter lists, in order of arrival.
    pub async fn jobs_with_keys(
        self: &Arc<Self>,
        owners: Owners,
        filter: &Filter,
        keys: Vec<i64>,
    ) -> Result<Vec<Job>> {
        let Some(filter) = filter.among(&owners) else {
            return Ok(vec![]);
        };
        self.read_list(move |store, connection| {
            let keys = serde_json::to_string(&keys)?;
            let mut query = Query::default();
            // each by its key: by the index of an owner, or of a label, all of their jobs would be read
            query.push("select job.* from json_each(");
            query.push_value(keys);
            query.push(") as wanted cross join job on job.id = wanted.value where true");
            conditions(&mut query, &filter, Some(Lane::All), OrderBy::CreatedAt);
            let window = Window {
                after: None,
                last: None,
                order: Order::OLDEST_FIRST,
            };
            let place = Place::of(Lane::All, OrderBy::CreatedAt);
            bounds(&mut query, &filter, place, window);
            query.push(" order by job.id");
            let mut jobs: Vec<Job> = connection.rows(query.sql(), query.values(), from_row)?;
            store.complete(connection, &mut jobs.iter_mut().collect::<Vec<_>>())?;
            Ok(jobs)
        })
        .await
    }

    /// The ids of the jobs with these keys, also of those that were deleted lately.
    pub async fn ids_of(self: &Arc<Self>, owners: Owners, keys: Vec<i64>) -> Result<Vec<JobId>> {
        const IDS: &str = "with wanted as (select value from json_each(?))
             select uuid, owner from job where id in wanted
             union all select uuid, owner from deleted_job where id in wanted";
        if keys.is_empty() {
            return Ok(vec![]);
        }
        self.read_list(move |_, connection| {
            let keys = serde_json::to_string(&keys)?;
            let found: Vec<(String, String)> =
                connection.rows(IDS, [keys], |row| Ok(row.try_into()?))?;
            let visible = found.into_iter().filter(|(_, owner)| owners.include(owner));
            let ids = visible.filter_map(|(uuid, _)| Some(JobId::from(uuid.parse::<Uuid>().ok()?)));
            Ok(ids.collect())
        })
        .await
    }

    /// The keys of at most `limit` jobs, in order of arrival, after the place `after` and up to the key `up_to`.
    pub async fn keys(
        self: &Arc<Self>,
        owners: Owners,
        filter: &Filter,
        after: Option<Cursor>,
        up_to: i64,
        limit: i64,
    ) -> Result<Keys> {
        let Some(filter) = filter.among(&owners) else {
            let (keys, next) = (vec![], None);
            return Ok(Keys { keys, next });
        };
        self.read_list(move |store, connection| {
            let values = values_of(&filter);
            let order = Order::OLDEST_FIRST;
            let (path, window) = choose(connection, &filter, &values, order, after)?;
            let columns = "job.id, job.created_at";
            let query = page(columns, &filter, &path, window, up_to, limit);
            let places: Vec<(i64, i64)> =
                connection.rows(query.sql(), query.values(), |row| Ok(row.try_into()?))?;
            store.damages.have_all(tables_of(&filter))?;
            let next = match places.last() {
                Some((key, micros)) if places.len() as i64 == limit => Some(Cursor {
                    micros: *micros,
                    key: *key,
                }),
                _ => window.last,
            };
            let keys = places.into_iter().map(|(key, _)| key).collect();
            Ok(Keys { keys, next })
        })
        .await
    }
}

/// The tables whose rows or indexes find the jobs of this filter.
fn tables_of(filter: &Filter) -> &'static [Table] {
    if filter.labels.is_empty() && filter.excluded_labels.is_empty() {
        &[Table::Jobs]
    } else {
        &[Table::Jobs, Table::Labels]
    }
}

/// The filters that are in use, each with its values.
pub(super) fn values_of(filter: &Filter) -> Vec<(&'static Field, Vec<Value>)> {
    let each = FILTERS.iter().map(|field| (field, (field.values)(filter)));
    each.filter(|(_, values)| !values.is_empty()).collect()
}

/// All ways to find the jobs of a list. The last way finds all jobs, in the order of the list.
pub(super) fn paths<'a>(
    filter: &'a Filter,
    values: &'a [(&'static Field, Vec<Value>)],
    order: Order,
) -> Vec<Path<'a>> {
    let mut paths = vec![];
    // several lanes are merged by a column, and no column has the time that a job has run
    let mut add = |by, lanes: Vec<Lane<'a>>| {
        if order.by != OrderBy::RunS || lanes.len() == 1 {
            paths.push(Path { lanes, by });
        }
    };
    for label in filter.labels.iter().take(MOST_LABEL_PATHS) {
        add(OrderBy::CreatedAt, vec![Lane::Label(label)]);
    }
    for (field, values) in values {
        if let Some(index) = field.index {
            let lane = |value| Lane::Value(index, field, value);
            add(OrderBy::CreatedAt, values.iter().map(lane).collect());
        }
    }
    for other in [OrderBy::CreatedAt, OrderBy::FinishedAt] {
        let bounds = |(field, _): &(&Field, _)| field.column == <&str>::from(other);
        if other != order.by && values.iter().any(bounds) {
            paths.push(Path::whole(other));
        }
    }
    paths.push(Path::whole(order.by));
    paths
}

/// The path for a page, and the part of it that the page reads. A path in the order of the list is read as far as the
/// limit of rows permits. A path in another order is only chosen if it can be read to its end, since its rows must be
/// sorted.
fn choose<'a>(
    connection: &Connection,
    filter: &'a Filter,
    values: &'a [(&'static Field, Vec<Value>)],
    order: Order,
    after: Option<Cursor>,
) -> Result<(Path<'a>, Window)> {
    // each row is looked up in the index of each label
    let most = (MOST_CHECKED / filter.labels.len().max(1) as i64).max(2);
    let end = Window {
        after,
        last: None,
        order,
    };
    let mut furthest = (Path::whole(order.by), end);
    for path in paths(filter, values, order) {
        let ordered = path.by == order.by;
        let begin = after.filter(|_| ordered);
        let query = reach(filter, &path, path.order(order), begin, most);
        let reached = connection.row(query.sql(), query.values(), |row| {
            let (micros, key) = row.try_into()?;
            Ok(Cursor { micros, key })
        })?;
        let Some(reached) = reached else {
            return Ok((path, end));
        };
        if ordered
            && furthest
                .1
                .last
                .is_none_or(|best| order.is_before(best, reached))
        {
            let last = Some(reached);
            furthest = (path, Window { last, ..end });
        }
    }
    Ok(furthest)
}

/// A query for the row of a path that is `most` rows after the place `after`; it finds nothing if the path ends before.
pub(super) fn reach(
    filter: &Filter,
    path: &Path<'_>,
    order: Order,
    after: Option<Cursor>,
    most: i64,
) -> Query {
    let mut query = Query::default();
    let window = Window {
        after,
        last: None,
        order,
    };
    merged(&mut query, path, "micros", order, most, |query, lane| {
        let place = Place::of(lane, path.by);
        let Place { at, id } = place;
        from(query, lane, path.by, &format!("{at} as micros, {id} as id"));
        bounds(query, filter, place, window);
        query.push(ordered(at, id, order));
    });
    query.push(" limit 1 offset ").push_value(most - 1);
    query
}

/// A query for at most `limit` jobs of a path, in order, with keys up to `up_to`.
pub(super) fn page(
    columns: &str,
    filter: &Filter,
    path: &Path<'_>,
    window: Window,
    up_to: i64,
    limit: i64,
) -> Query {
    let mut query = Query::default();
    let order = window.order;
    let by = <&str>::from(order.by);
    merged(&mut query, path, by, order, limit, |query, lane| {
        // rows that are sorted are those of the table
        let place = if path.by == order.by {
            Place::of(lane, order.by)
        } else {
            Place::of(Lane::All, order.by)
        };
        from(query, lane, path.by, columns);
        let (_, _, has_time) = order.by.sql();
        query.push(format!(" and {has_time}"));
        if up_to < i64::MAX {
            query.push(" and job.id <= ").push_value(up_to);
        }
        conditions(query, filter, Some(lane), order.by);
        bounds(query, filter, place, window);
        query.push(ordered(place.at, place.id, order));
    });
    query.push(" limit ").push_value(limit);
    query
}

/// Adds the lanes of a path to a query, each with at most `most` rows, merged in order.
fn merged<'a>(
    query: &mut Query,
    path: &Path<'a>,
    by: &str,
    order: Order,
    most: i64,
    lane: impl Fn(&mut Query, Lane<'a>),
) {
    if let [only] = path.lanes[..] {
        return lane(query, only);
    }
    for (n, one) in path.lanes.iter().enumerate() {
        query.push(if n == 0 {
            "select * from ("
        } else {
            " union all select * from ("
        });
        lane(query, *one);
        query.push(" limit ").push_value(most).push(")");
    }
    query.push(ordered(by, "id", order));
}

fn ordered(at: &str, id: &str, order: Order) -> String {
    let direction = order.direction();
    format!(" order by {at} {direction}, {id} {direction}")
}

/// Adds the rows of a lane to a query. It has `indexed by`, since SQLite does not know how many jobs a filter matches,
/// and would guess.
fn from(query: &mut Query, lane: Lane<'_>, by: OrderBy, columns: &str) {
    match lane {
        Lane::Label((key, value)) => {
            // a place in the index needs no job
            let job = if columns.contains("job.") {
                " cross join job on job.id = job_label.job_id"
            } else {
                ""
            };
            query.push(format!(
                "select {columns} from job_label{job} where job_label.key = "
            ));
            query
                .push_value(key.clone())
                .push(" and job_label.value = ");
            query.push_value(value.clone());
        }
        Lane::Value(index, field, value) => {
            let column = field.column;
            query.push(format!(
                "select {columns} from job indexed by {index} where {column} = "
            ));
            query.push_value(value.clone());
        }
        Lane::All => {
            let (_, index, all) = by.sql();
            query.push(format!(
                "select {columns} from job indexed by {index} where {all}"
            ));
        }
    }
}

/// A query for the number of jobs in each group.
pub(super) fn counted(filter: &Filter, group_by: Option<&GroupBy>) -> Query {
    const OF_LABELS: &str = "as kind, count(*) as jobs from job_label
         cross join job on job.id = job_label.job_id where";
    let mut query = Query::default();
    let mut of_jobs = |group: &str| {
        query.push(format!(
            "select {group} as kind, count(*) as jobs from job where true"
        ));
    };
    match group_by {
        None => of_jobs("''"),
        Some(GroupBy::Status) => of_jobs("status"),
        Some(GroupBy::Owner) => of_jobs("owner"),
        Some(GroupBy::Verdict) => of_jobs("coalesce(verdict, 'none')"),
        Some(GroupBy::LabelKeys) => {
            query.push(format!("select job_label.key {OF_LABELS} true"));
        }
        Some(GroupBy::Label(key)) => {
            query.push(format!(
                "select job_label.value {OF_LABELS} job_label.key = "
            ));
            query.push_value(key.clone());
        }
    }
    conditions(&mut query, filter, None, OrderBy::CreatedAt);
    let window = Window {
        after: None,
        last: None,
        order: Order::NEWEST_FIRST,
    };
    let place = Place::of(Lane::All, OrderBy::CreatedAt);
    bounds(&mut query, filter, place, window);
    query.push(" group by kind order by jobs desc, kind limit ");
    query.push_value(GroupBy::MOST);
    query
}

/// Adds the conditions of a filter to a query, except those of the lane and of the time that orders the list.
fn conditions(query: &mut Query, filter: &Filter, lane: Option<Lane<'_>>, by: OrderBy) {
    for (field, values) in values_of(filter) {
        let of_lane = matches!(lane, Some(Lane::Value(_, own, _)) if own.name == field.name);
        if of_lane || field.column == <&str>::from(by) {
            continue;
        }
        /// The columns in which people look for a text.
        const MENTIONED: &str =
            "coalesce(job.name, '') || char(10) || coalesce(job.title, '') || char(10) || job.owner
             || char(10) || 'job_' || job.uuid || char(10) || job.labels";
        let column = field.column;
        // a code has no characters that JSON would escape
        let (before, between, after) = match field.comparison {
            Comparison::Is => (format!("job.{column} in ("), ", ".to_owned(), ")"),
            Comparison::From => (format!("job.{column} >= "), String::new(), ""),
            Comparison::Before => (format!("job.{column} < "), String::new(), ""),
            Comparison::Contains => (
                format!("instr(lower(job.{column}), lower("),
                String::new(),
                ")) > 0",
            ),
            Comparison::Mentions => (
                format!("instr(lower({MENTIONED}), lower("),
                String::new(),
                ")) > 0",
            ),
            Comparison::HasCode => (
                format!("(instr(job.{column}, "),
                format!(") > 0 or instr(job.{column}, "),
                ") > 0)",
            ),
        };
        query.push(format!(" and {before}"));
        for (n, value) in values.into_iter().enumerate() {
            query.push(if n == 0 { "" } else { &between });
            query.push_value(value);
        }
        query.push(after);
    }
    for (key, value) in &filter.excluded_labels {
        query.push(
            " and not exists (select 1 from job_label where created_at = job.created_at and job_id = job.id and key = ",
        );
        query.push_value(key.clone()).push(" and value = ");
        query.push_value(value.clone()).push(")");
    }
    for label in &filter.labels {
        match lane {
            Some(Lane::Label(own)) if own == label => continue,
            // one lookup for each row of the lane
            Some(_) => query.push(
                " and exists (select 1 from job_label where created_at = job.created_at and job_id = job.id and key = ",
            ),
            None => query.push(" and job.id in (select job_id from job_label where key = "),
        };
        let (key, value) = label.clone();
        query.push_value(key).push(" and value = ");
        query.push_value(value).push(")");
    }
}

/// The names of two columns of a lane: the time that orders its rows, and the key of the job.
#[derive(Clone, Copy)]
struct Place {
    at: &'static str,
    id: &'static str,
}

impl Place {
    fn of(lane: Lane<'_>, by: OrderBy) -> Place {
        match (lane, by) {
            (Lane::Label(_), OrderBy::CreatedAt) => Place {
                at: "job_label.created_at",
                id: "job_label.job_id",
            },
            (_, by) => Place {
                at: by.sql().0,
                id: "job.id",
            },
        }
    }
}

/// Adds the bounds of the time that orders the rows, and those of the window, to a query. No job ends before it was
/// accepted: a bound on one time is also one on the other. A bound that the window implies is left out, since SQLite
/// would search the index by the weaker bound.
fn bounds(query: &mut Query, filter: &Filter, place: Place, window: Window) {
    let Place { at, id } = place;
    let Window { after, last, order } = window;
    let (least, most) = match order.by {
        OrderBy::CreatedAt => {
            let before = [filter.created_before, filter.finished_before];
            (filter.created_after, before.into_iter().flatten().min())
        }
        OrderBy::FinishedAt => (
            filter.finished_after.max(filter.created_after),
            filter.finished_before,
        ),
        OrderBy::RunS => (None, None),
    };
    let (lower, upper) = if order.descending {
        (last, after)
    } else {
        (after, last)
    };
    for (time, comparison, implied) in [(least, ">=", lower), (most, "<", upper)] {
        if let (Some(time), None) = (time, implied) {
            query.push(format!(" and {at} {comparison} "));
            query.push_value(time.micros());
        }
    }
    for (place, comparison) in [
        (after, if order.descending { "<" } else { ">" }),
        (last, if order.descending { ">=" } else { "<=" }),
    ] {
        if let Some(Cursor { micros, key }) = place {
            if order.by == OrderBy::RunS {
                // an index on an expression is searched by a bound on the expression, and not by one on a row of values
                query.push(format!(" and {at} {}= ", &comparison[..1]));
                query.push_value(micros);
            }
            query.push(format!(" and ({at}, {id}) {comparison} ("));
            query
                .push_value(micros)
                .push(", ")
                .push_value(key)
                .push(")");
        }
    }
}
