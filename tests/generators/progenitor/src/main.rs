//! A study with the client that progenitor generates: URL PROBLEM COEFFICIENT ...

use client::{Client, types};

#[tokio::main(flavor = "current_thread")]
async fn main() {
    let mut arguments = std::env::args().skip(1);
    let client = Client::new(&arguments.next().expect("URL"));
    let text = std::fs::read_to_string(arguments.next().expect("PROBLEM")).expect("a file");
    for coefficient in arguments {
        let mut problem: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let coefficient: f64 = coefficient.parse().expect("a number");
        problem["contacts"][0]["friction"]["coefficient"] = coefficient.into();
        let submission = serde_json::json!({ "problem": problem });
        let body: types::Submission = serde_json::from_value(submission).expect("a submission");
        let job = client.create_job(None, Some("wait=30"), &body).await.expect("a job");
        let result = client.get_result(&job.id).await.expect("a result");
        println!("{:?}", result.summary.normal_force);
    }
}
