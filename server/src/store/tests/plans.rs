//! Frequent queries, and queries over very many jobs, use indexes.

use super::*;

/// The steps of the database's query plan.
async fn plan(store: &Store, question: &str) -> Vec<String> {
    let plan = sqlx::AssertSqlSafe(format!("explain query plan {question}"));
    let plan: Vec<(i64, i64, i64, String)> =
        sqlx::query_as(plan).fetch_all(&store.reader).await.unwrap();
    plan.into_iter().map(|(.., step)| step).collect()
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
        positions::WAITING,
        end::EXPIRED,
        coalescing::EARLIER_RESULT,
        coalescing::PRIMARY,
    ] {
        let steps = plan(&store, question).await;
        assert!(steps[0].contains("INDEX job_"), "{question}: {steps:?}");
        assert!(!sorts(&steps), "{question}: {steps:?}");
    }
}

/// A page of one owner's jobs reads no jobs of others and needs no sort, whatever others have the same label, status or name;
/// counts and bulk changes read that owner's jobs alone.
#[tokio::test]
async fn lists_of_one_owner_use_indexes() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let mine = Filter {
        owner: Some("ada".into()),
        ..Filter::default()
    };
    let (labels, statuses) = (vec![("a".into(), "b".into())], vec![Status::Failed]);
    for (filter, index, index_by_end) in [
        (
            mine.clone(),
            "job_by_owner ",
            "job_by_owner_status_finished ",
        ),
        (
            Filter {
                statuses,
                ..mine.clone()
            },
            "job_by_owner_status ",
            "job_by_owner_status_finished ",
        ),
        (
            Filter {
                name: Some("c".into()),
                ..mine.clone()
            },
            "job_by_owner_name ",
            "job_by_owner_status_finished ",
        ),
        (
            Filter {
                labels,
                ..mine.clone()
            },
            "job_label_by_owner ",
            "job_by_owner_status_finished ",
        ),
    ] {
        for by in [OrderBy::CreatedAt, OrderBy::FinishedAt] {
            for descending in [true, false] {
                let order = Order { by, descending };
                for cursor in [None, Some(Cursor { micros: 1, key: 1 })] {
                    let paths = list::ordered_paths(&filter, order);
                    for path in paths {
                        let question = list::page_of_jobs(&filter, &[path], order, cursor, 50);
                        let steps = plan(&store, question.sql().as_str()).await;
                        let index = if by == OrderBy::CreatedAt {
                            index
                        } else {
                            index_by_end
                        };
                        let uses = steps.iter().any(|step| {
                            step.starts_with("SEARCH") && step.contains(&format!("INDEX {index}"))
                        });
                        assert!(uses, "{index}: {steps:?}");
                        assert!(
                            !steps.iter().any(|step| step.starts_with("SCAN job")),
                            "{steps:?}"
                        );
                        assert!(!sorts(&steps), "{steps:?}");
                    }
                }
            }
        }
    }
    let counted = list::counted(&mine, Some(GroupBy::Status));
    let steps = plan(&store, counted.sql().as_str()).await;
    assert!(steps[0].contains("job_by_owner"), "{steps:?}");
    let keys = list::keys_of_jobs(&mine, 0, 1000, 100);
    let steps = plan(&store, keys.sql().as_str()).await;
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
