//! Pages of lists, one after the other, have the jobs that a filter matches, in order, however few rows are checked for
//! each page.

use std::collections::BTreeSet;

use base::{job::JobId, time::Time};
use fastrand::Rng;

use super::*;

/// Jobs of all kinds, some of which have ended, in another order than that of their arrival.
async fn many(store: &Arc<Store>, dice: &mut Rng) -> Vec<Job> {
    for n in 0..60 {
        let owner = ["ada", "bob", "cyd"][dice.usize(0..3)];
        let labels = [("half", n % 2), ("part", n % 9)];
        let labels = labels.map(|(key, value)| (key.to_owned(), value.to_string()));
        let job = NewJob {
            id: Some(JobId::new()),
            name: dice.bool().then(|| format!("run {}", n % 4)),
            labels: labels.into_iter().filter(|_| dice.u8(0..5) > 0).collect(),
            priority: dice.i32(-5..5),
            ..new(&dice.u8(0..5).to_string())
        };
        let submission = by(owner, vec![job], None);
        store.submit(submission, false).await.unwrap();
    }
    for n in 0..40 {
        let Some(Claim { job, .. }) = store.claim_next().await.unwrap().0 else {
            break;
        };
        if n > 35 {
            continue; // still running
        }
        let ending = Ending {
            status: [Status::Succeeded, Status::Canceled][dice.usize(0..2)],
            reason: None,
            failure: None,
            result: ResultAvailable::None,
            overview: Default::default(),
        };
        let last = FinalBatch::default();
        let finished = store.finish(job.key, job.attempt, &ending, last, None);
        finished.await.unwrap().unwrap();
    }
    let all = (Owners::All, &Filter::default());
    let jobs = store.jobs(all.0, all.1, Order::OLDEST_FIRST, None, 1000);
    jobs.await.unwrap()
}

fn matches(filter: &Filter, job: &Job) -> bool {
    let given = |asked: &Option<String>, own: Option<&str>| {
        asked.as_deref().is_none_or(|asked| own == Some(asked))
    };
    (filter.statuses.is_empty() || filter.statuses.contains(&job.status))
        && given(&filter.owner, Some(&job.owner))
        && given(&filter.name, job.name.as_deref())
        && given(&filter.input_hash, Some(&job.input_hash))
        && filter.name_contains.as_deref().is_none_or(|part| {
            let name = job.name.as_deref().unwrap_or_default();
            name.to_ascii_lowercase()
                .contains(&part.to_ascii_lowercase())
        })
        && filter.text.as_deref().is_none_or(|text| {
            let (name, labels) = (
                job.name.clone().unwrap_or_default(),
                format!("{:?}", job.labels),
            );
            let all = format!("{name}\n{}\n{}\n{labels}", job.owner, job.id);
            all.to_ascii_lowercase()
                .contains(&text.to_ascii_lowercase())
        })
        && filter.pinned.is_none_or(|pinned| job.pinned == pinned)
        && (filter.ids.is_empty() || filter.ids.contains(&job.id))
        && filter
            .excluded_labels
            .iter()
            .all(|(key, value)| job.labels.get(key) != Some(value))
        && filter
            .labels
            .iter()
            .all(|(key, value)| job.labels.get(key) == Some(value))
        && filter
            .created_after
            .is_none_or(|time| job.created_at >= time)
        && filter
            .created_before
            .is_none_or(|time| job.created_at < time)
        && filter
            .finished_after
            .is_none_or(|time| job.finished_at.is_some_and(|own| own >= time))
        && filter
            .finished_before
            .is_none_or(|time| job.finished_at.is_some_and(|own| own < time))
}

/// A filter of several conditions, with values that some jobs have.
fn some_filter(jobs: &[Job], dice: &mut Rng) -> Filter {
    let mut filter = Filter::default();
    let mut sample = || &jobs[dice.usize(0..jobs.len())];
    let (a, b, c, d) = (sample(), sample(), sample(), sample());
    let mut now_and_then = || dice.u8(0..3) == 0;
    if now_and_then() {
        filter.statuses = BTreeSet::from([<&str>::from(a.status), <&str>::from(b.status)])
            .into_iter()
            .map(|word| word.parse().unwrap())
            .collect();
    }
    if now_and_then() {
        filter.owner = Some(a.owner.clone());
    }
    if now_and_then() {
        filter.name.clone_from(&c.name);
    }
    if now_and_then() {
        filter.input_hash = Some(b.input_hash.clone());
    }
    if now_and_then() && now_and_then() {
        filter.name_contains = Some("RUN".into());
    }
    if now_and_then() && now_and_then() {
        filter.text = Some(b.owner.to_ascii_uppercase());
    }
    if now_and_then() && now_and_then() {
        filter.ids = jobs.iter().step_by(3).map(|job| job.id).collect();
    }
    if now_and_then() && now_and_then() {
        filter.pinned = Some(false);
    }
    for (key, value) in &a.labels {
        if now_and_then() && now_and_then() {
            filter.excluded_labels.push((key.clone(), value.clone()));
        }
    }
    for (key, value) in &d.labels {
        if now_and_then() {
            filter.labels.push((key.clone(), value.clone()));
        }
    }
    for (bound, time) in [
        (&mut filter.created_after, Some(a.created_at)),
        (&mut filter.created_before, Some(b.created_at)),
        (&mut filter.finished_after, c.finished_at),
        (&mut filter.finished_before, d.finished_at),
    ] {
        if now_and_then() && now_and_then() {
            *bound = time;
        }
    }
    filter
}

#[tokio::test]
async fn pages_have_the_jobs_that_match_in_order() {
    let mut dice = Rng::with_seed(7);
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let jobs = many(&store, &mut dice).await;
    assert_eq!(jobs.len(), 60);
    let (mut short, mut empty, mut found_some) = (0, 0, 0);
    for _ in 0..400 {
        let filter = some_filter(&jobs, &mut dice);
        let owners = [Owners::All, Owners::Only("ada".into())][dice.usize(0..2)].clone();
        let by = [OrderBy::CreatedAt, OrderBy::FinishedAt, OrderBy::RunS][dice.usize(0..3)];
        let order = Order {
            by,
            descending: dice.bool(),
        };
        let at = |job: &Job| match by {
            OrderBy::CreatedAt => Some((job.created_at, job.key)),
            OrderBy::FinishedAt => job.finished_at.map(|time| (time, job.key)),
            OrderBy::RunS => {
                let run = job.finished_at?.micros() - job.started_at?.micros();
                Some((Time::from_micros(run), job.key))
            }
        };
        let mine = |job: &&Job| matches!(owners, Owners::All) || job.owner == "ada";
        let found = jobs.iter().filter(mine).filter(|job| matches(&filter, job));
        let mut expected: Vec<_> = found.filter_map(at).collect();
        expected.sort_unstable();
        if order.descending {
            expected.reverse();
        }
        let limit = dice.i64(1..20);
        let (mut listed, mut cursor) = (vec![], None);
        loop {
            let page = store
                .some_jobs(owners.clone(), &filter, order, cursor, limit)
                .await
                .unwrap();
            assert!(page.items.len() as i64 <= limit);
            listed.extend(page.items.iter().filter_map(at));
            let last = page.items.last().and_then(at).map(|(time, key)| Cursor {
                micros: time.micros(),
                key,
            });
            let full = page.items.len() as i64 == limit;
            cursor = if full { last } else { page.checked_to };
            short += usize::from(!full && cursor.is_some());
            empty += usize::from(page.items.is_empty() && cursor.is_some());
            if cursor.is_none() {
                break;
            }
        }
        found_some += usize::from(!listed.is_empty());
        assert_eq!(listed, expected, "{filter:?} {order:?} {limit}");
        if by == OrderBy::CreatedAt && !order.descending {
            let (mut keys, mut after) = (vec![], None);
            loop {
                let some = store
                    .keys(owners.clone(), &filter, after, jobs[49].key, limit)
                    .await
                    .unwrap();
                keys.extend(some.keys);
                after = some.next;
                if after.is_none() {
                    break;
                }
            }
            let expected = expected.iter().map(|(_, key)| *key);
            let expected: Vec<i64> = expected.filter(|key| *key <= jobs[49].key).collect();
            assert_eq!(keys, expected, "{filter:?}");
        }
        let counted = store.count(owners.clone(), &filter, None).await.unwrap();
        let all = jobs
            .iter()
            .filter(mine)
            .filter(|job| matches(&filter, job))
            .count();
        assert_eq!(
            counted.iter().map(|(_, jobs)| jobs).sum::<i64>(),
            all as i64,
            "{filter:?}"
        );
    }
    assert!(
        short > 100 && empty > 20 && found_some > 100,
        "{short} {empty} {found_some}"
    );
}
