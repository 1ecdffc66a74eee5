//! Models: one of a name for each owner, not served if a disk has changed it, kept by a salvage.

use super::*;
use crate::model::{Description, Model, Output};

fn description(pointer: &str) -> Description {
    Description {
        title: None,
        inputs: vec![vec![pointer.into()]],
        outputs: vec![Output::Scalars {
            scalars: vec!["normal_force".into()],
        }],
        base_input: vec![vec![0.1]],
    }
}

async fn put(store: &Store, owner: &str, name: &str, pointer: &str) -> Option<(Model, bool)> {
    let problem = format!("{{\"of\":\"{owner} {name} {pointer}\"}}");
    let description = description(pointer);
    let put = store.put_model((owner, name), &description, &problem, 2);
    put.await.unwrap()
}

#[tokio::test]
async fn a_model_is_its_owners_and_is_replaced_under_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let (first, new) = put(&store, "ada", "punch", "/a").await.unwrap();
    assert!(new);
    let (other, new) = put(&store, "bob", "punch", "/b").await.unwrap();
    assert!(new && other.key != first.key);
    let (again, new) = put(&store, "ada", "punch", "/c").await.unwrap();
    assert!(!new);
    assert_eq!((again.key, again.created_at), (first.key, first.created_at));
    assert!(again.updated_at >= first.updated_at);
    let (ada, bob) = (Owners::Only("ada"), Owners::Only("bob"));
    let found = store.model(ada, "ada", "punch").await.unwrap();
    assert_eq!(found, Some(again.clone()));
    let whole = store.model_with_problem(bob, "bob", "punch").await.unwrap();
    assert_eq!(
        whole,
        Some((other.clone(), "{\"of\":\"bob punch /b\"}".into()))
    );
    assert_eq!(store.model(bob, "bob", "other").await.unwrap(), None);
    // who sees all finds their own first, then the oldest
    for (first, key) in [("bob", other.key), ("ada", again.key), ("eve", again.key)] {
        let found = store.model(Owners::All, first, "punch").await.unwrap();
        assert_eq!(found.unwrap().key, key);
    }
    // two at most; to replace one is no third
    assert!(put(&store, "ada", "second", "/a").await.is_some());
    assert!(put(&store, "ada", "third", "/a").await.is_none());
    assert!(put(&store, "ada", "second", "/b").await.is_some());
    let listed = async |owners, before| -> Vec<String> {
        let models = store.models(owners, before, 10).await.unwrap();
        let label = |model: Model| format!("{} {}", model.owner, model.name);
        models.into_iter().map(label).collect()
    };
    assert_eq!(listed(ada, None).await, ["ada second", "ada punch"]);
    assert_eq!(listed(Owners::All, Some(other.key)).await, ["ada punch"]);
    assert!(store.delete_model(again.key).await.unwrap());
    assert!(!store.delete_model(again.key).await.unwrap());
    assert_eq!(listed(Owners::All, None).await, ["ada second", "bob punch"]);
    store.close().await;
    let report = inspect(folder.path(), None).await.unwrap();
    assert!(report.findings.is_empty(), "{report:?}");
}

#[tokio::test]
async fn a_damaged_model_is_not_served_and_the_others_are_saved() {
    let (folder, new_folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let store = Store::open(folder.path()).await.unwrap();
    let all = Owners::All;
    for owner in ["ada", "bob", "eve"] {
        put(&store, owner, "punch", "/a").await.unwrap();
    }
    let change = async |statement: &'static str| {
        sqlx::query(statement).execute(&store.writer).await.unwrap();
    };
    change("update model set description = replace(description, '/a', '/b') where owner = 'ada'")
        .await;
    change("update model_problem set body = '{}' where model = (select id from model where owner = 'bob')").await;
    let damaged = store.model(all, "ada", "punch").await;
    assert!(
        matches!(&damaged, Err(StoreError::Damaged(damage)) if damage.record.name == "model number 1")
    );
    let damaged = store.model_with_problem(all, "bob", "punch").await;
    assert!(
        matches!(&damaged, Err(StoreError::Damaged(damage)) if damage.record.name == "problem of model number 2")
    );
    assert!(store.model_with_problem(all, "eve", "punch").await.is_ok());
    store.close().await;
    drop(store);
    let report = inspect(folder.path(), Some(new_folder.path()))
        .await
        .unwrap();
    let told = report.findings.join("\n");
    assert!(
        told.contains("model number 1") && told.contains("problem of model number 2"),
        "{told}"
    );
    let saved = Store::open(new_folder.path()).await.unwrap();
    let kept = saved.model_with_problem(all, "eve", "punch").await.unwrap();
    assert_eq!(kept.unwrap().1, "{\"of\":\"eve punch /a\"}");
    assert_eq!(saved.models(all, None, 10).await.unwrap().len(), 1);
}
