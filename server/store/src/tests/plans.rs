//! Frequent queries, and queries over very many jobs, use indexes.

use base::time::Time;

use super::{super::list::Window, *};

/// The steps of the database's query plan.
async fn plan(store: &Arc<Store>, question: &str) -> Vec<String> {
    let plan = format!("explain query plan {question}");
    let plan = store.read(move |_, connection| {
        let mut statement = connection.prepare(&plan)?;
        let mut rows = statement.raw_query(); // without parameters
        let mut steps = vec![];
        while let Some(row) = rows.next()? {
            steps.push(row.get("detail")?);
        }
        Ok(steps)
    });
    plan.await.unwrap()
}

fn sorts(steps: &[String]) -> bool {
    steps.iter().any(|step| step.contains("TEMP B-TREE"))
}

/// The queries of every submission, start and periodic task read as many rows as they return, however many jobs
/// there are.
#[tokio::test]
async fn the_queries_of_the_queue_use_indexes() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for question in [
        end::EXPIRED,
        coalescing::EARLIER_RESULT,
        coalescing::PRIMARY,
    ] {
        let steps = plan(&store, question).await;
        assert!(steps[0].contains("INDEX job_"), "{question}: {steps:?}");
        assert!(!sorts(&steps), "{question}: {steps:?}");
    }
}

/// A claim looks at one job of each owner who has any.
#[tokio::test]
async fn a_claim_does_not_read_the_jobs_that_wait() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let steps = plan(&store, turns::NEXT).await;
    let jobs = steps.iter().filter(|step| step.contains(" job "));
    let jobs: Vec<&String> = jobs.collect();
    assert!(
        !jobs.is_empty()
            && jobs
                .iter()
                .all(|step| step.contains("INDEX job_queue (priority=? AND owner=?")),
        "{steps:?}"
    );
}

/// A page is read along an index, from its cursor to the row that is the last to be checked, without a sort; how far an
/// index gets is read from it alone.
#[tokio::test]
async fn lists_are_read_within_a_part_of_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let mine = Filter {
        owner: Some("ada".into()),
        ..Filter::default()
    };
    let all = Filter {
        statuses: vec![Status::Failed, Status::Canceled],
        labels: vec![("a".into(), "b".into())],
        name: Some("c".into()),
        created_after: Some(Time::from_micros(1)),
        finished_before: Some(Time::from_micros(9)),
        ..mine.clone()
    };
    let place = |n| Some(Cursor { micros: n, key: n });
    for by in [OrderBy::CreatedAt, OrderBy::FinishedAt, OrderBy::RunS] {
        for descending in [true, false] {
            let order = Order { by, descending };
            for (after, last) in [(None, None), (place(5), place(3)), (None, place(3))] {
                let values = list::values_of(&all);
                let paths = list::paths(&all, &values, order);
                assert!(paths.len() > 4);
                for path in &paths {
                    let own = path.order(order);
                    let reach = list::reach(&all, path, own, after, 100);
                    let window = Window { after, last, order };
                    let page = list::page("job.*", &all, path, window, i64::MAX, 50);
                    let queries = [(reach, true), (page, own == order)];
                    for (query, ordered) in queries {
                        let sql = query.sql().to_owned();
                        let steps = plan(&store, &sql).await;
                        let read =
                            |step: &&String| step.contains(" job") && !step.contains("COMPOUND");
                        for step in steps.iter().filter(read) {
                            assert!(
                                step.contains("INDEX job_") || step.contains("PRIMARY KEY"),
                                "{sql}: {steps:?}"
                            );
                        }
                        // the parts of several values are merged, each within a limit
                        let merged = sql.contains("union all");
                        assert!(!ordered || merged || !sorts(&steps), "{sql}: {steps:?}");
                        // both ends of the part are found in the index
                        let ends =
                            after.is_some() && last.is_some() && ordered && sql.contains("job.*");
                        let bounded = |step: &String| step.contains('>') && step.contains('<');
                        assert!(!ends || steps.iter().any(bounded), "{sql}: {steps:?}");
                    }
                }
            }
        }
    }
    let counted = list::counted(&mine, Some(&GroupBy::Status));
    let steps = plan(&store, counted.sql()).await;
    assert!(
        steps[0].contains("COVERING INDEX job_by_owner"),
        "{steps:?}"
    );
}

/// What is done every few seconds reads as many rows as it changes.
#[tokio::test]
async fn the_queries_of_retention_use_indexes() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for question in [
        retention::OLD_JOBS,
        retention::OLD_FIELDS,
        retention::OLDEST_OF_OWNER,
        forget::BEYOND,
        keys::FORGET,
        sizes::WAITING_BYTES,
    ] {
        let steps = plan(&store, question).await;
        let scans = steps
            .iter()
            .any(|step| step.starts_with("SCAN") && !step.contains("INDEX"));
        assert!(!scans && !sorts(&steps), "{question}: {steps:?}");
    }
    let steps = plan(&store, retention::KEPT).await;
    assert!(
        steps.iter().any(|step| step.contains("job_pinned")),
        "{steps:?}"
    );
}
