//! The stream of a list: what is told of jobs, sweeps, counts and the queue, over both protocols.

use std::pin::Pin;

use futures_util::{Stream, StreamExt};
use reqwest::RequestBuilder;
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, server_sent, soon},
};
use tonic::Request;

use crate::{auth::create, server};

/// The events of a list, with the last id that was told.
struct List {
    events: Pin<Box<dyn Stream<Item = (String, Value)> + Send>>,
    last: String,
}

impl List {
    async fn of(request: RequestBuilder) -> List {
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        List {
            events: Box::pin(server_sent(response)),
            last: String::new(),
        }
    }

    /// Reads until all of the wanted have come, in any order, and gives what has come.
    async fn until(&mut self, wanted: &[&dyn Fn(&Value) -> bool]) -> Vec<Value> {
        let mut seen: Vec<Value> = vec![];
        while !wanted.iter().all(|one| seen.iter().any(one)) {
            let next = soon("an event of the list", self.events.next()).await;
            let (id, event) = next.unwrap_or_else(|| panic!("ended after {seen:#?}"));
            if !id.is_empty() {
                self.last = id;
            }
            seen.push(event);
        }
        seen
    }
}

fn is(kind: &'static str) -> impl Fn(&Value) -> bool {
    move |event| event["type"] == kind
}

async fn job_of(server: &Server, label: &str, token: Option<&str>) -> String {
    let body =
        json!({"problem": example_json("sheet"), "cache": "off", "labels": {"study": label}});
    let mut request = server.post("/v1/jobs").json(&body);
    if let Some(token) = token {
        request = request.bearer_auth(token);
    }
    let job: Value = request.send().await.unwrap().json().await.unwrap();
    job["id"].as_str().unwrap().to_owned()
}

/// Operations: WatchJobs
#[tokio::test]
async fn a_list_tells_of_its_jobs_and_goes_on_after_its_last_id() {
    let server = server().await;
    let mut list = List::of(server.get("/v1/events?label.study=a")).await;
    list.until(&[&is("counts"), &is("queue")]).await;
    let (wanted, other) = (
        job_of(&server, "a", None).await,
        job_of(&server, "b", None).await,
    );
    let ended = |id: &str| {
        let id = id.to_owned();
        move |event: &Value| event["job"]["id"] == *id && event["job"]["status"] == "succeeded"
    };
    let counted = |event: &Value| event["counts"]["groups"]["succeeded"] == 1;
    let seen = list.until(&[&ended(&wanted), &counted]).await;
    let told = seen.iter().filter(|event| event["type"] == "job");
    for event in told {
        assert_eq!(event["job"]["id"], *wanted);
        assert_eq!(event["job"]["links"], json!({}));
    }
    let whole = server.job(&wanted).await;
    let last = seen.iter().rfind(|event| event["type"] == "job").unwrap();
    assert_eq!(last["job"]["verdict"], whole["verdict"]);
    assert_eq!(last["job"]["quantities"], whole["quantities"]);

    server.until_done(&other).await;
    // what happens without a listener is told afterwards: a job that is deleted, one that leaves the list
    let id = std::mem::take(&mut list.last);
    drop(list);
    server
        .delete(&format!("/v1/jobs/{wanted}"))
        .send()
        .await
        .unwrap();
    let moved = job_of(&server, "a", None).await;
    server.until_done(&moved).await;
    let relabel = server.request(reqwest::Method::PATCH, &format!("/v1/jobs/{moved}"));
    let relabel = relabel.json(&json!({"labels": {"study": "c"}}));
    assert_eq!(relabel.send().await.unwrap().status(), 200);
    let request = server.get("/v1/events?label.study=a");
    let mut list = List::of(request.header("Last-Event-ID", id)).await;
    let removed = |id: &str| {
        let id = id.to_owned();
        move |event: &Value| event["type"] == "removed" && event["id"] == *id
    };
    let seen = list.until(&[&removed(&wanted), &removed(&moved)]).await;
    assert!(!seen.iter().any(is("reset")));

    // an id of another process, or no id at all, is answered by the advice to read the list again
    for wrong in ["0000-5", "7", "x", ""] {
        let mut list = List::of(server.get(&format!("/v1/events?after={wrong}"))).await;
        let seen = list.until(&[&is("queue")]).await;
        assert!(seen.iter().any(is("reset")), "{wrong:?}");
    }
    let rows = server
        .get("/v1/events?status=nothing")
        .send()
        .await
        .unwrap();
    assert_eq!(rows.status(), 400);
}

#[tokio::test]
async fn a_list_tells_of_sweeps_and_of_the_queue() {
    let server = server().await;
    let mut list = List::of(server.get("/v1/events")).await;
    list.until(&[&is("counts"), &is("queue")]).await;
    let axes = json!([{ "path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2, 0.3] }]);
    let sweep = json!({"base": example_json("sheet"), "axes": axes});
    let sweep: Value = server
        .post("/v1/sweeps")
        .json(&sweep)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let whole = |event: &Value| {
        event["sweep"]["id"] == sweep["id"] && event["sweep"]["status"] == "succeeded"
    };
    let seen = list.until(&[&whole]).await;
    let last = seen.iter().rfind(|event| event["type"] == "sweep").unwrap();
    assert_eq!(last["sweep"]["members"]["succeeded"], 3, "{last:#}");
    server.post("/v1/queue/pause").send().await.unwrap();
    list.until(&[&|event| event["queue"]["paused"] == true])
        .await;
}

/// Over gRPC as over REST, and of the jobs of others nothing.
#[tokio::test]
async fn nobody_is_told_of_the_jobs_of_others() {
    let server = server().await;
    let token =
        |owner: &str, scopes: &[&str]| json!({"name": "t", "owner": owner, "scopes": scopes});
    let (_, admin) = create(&server, None, token("root", &["admin"])).await;
    let (_, ada) = create(&server, Some(&admin), token("ada", &["read", "submit"])).await;
    let (_, bob) = create(&server, Some(&admin), token("bob", &["read", "submit"])).await;
    let mut list = List::of(server.get("/v1/events").bearer_auth(&ada)).await;
    let mut grpc = JobServiceClient::connect(server.url.clone()).await.unwrap();
    let mut request = Request::new(pb::WatchJobsRequest::default());
    let value = format!("Bearer {ada}").parse().unwrap();
    request.metadata_mut().insert("authorization", value);
    let mut watched = grpc.watch_jobs(request).await.unwrap().into_inner();
    list.until(&[&is("counts"), &is("queue")]).await;
    let others = job_of(&server, "x", Some(&bob)).await;
    let own = job_of(&server, "x", Some(&ada)).await;
    let counted = |event: &Value| event["counts"]["groups"]["succeeded"] == 1;
    let seen = list.until(&[&counted]).await;
    let text = Value::Array(seen).to_string();
    assert!(text.contains(&own) && !text.contains(&others), "{text}");
    loop {
        let event = soon("an event", watched.message()).await.unwrap().unwrap();
        let text = format!("{event:?}");
        assert!(!text.contains(&others));
        if text.contains(&own) {
            break;
        }
    }
}
