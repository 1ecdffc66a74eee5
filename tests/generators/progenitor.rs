//! A study with the client that progenitor generates: URL PROBLEM COEFFICIENT ...

use std::{env, error::Error, fs};

use client::{Client, types};
use serde_json::{Map, Value, json};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let mut next = || arguments.next().ok_or("usage: URL PROBLEM COEFFICIENT ...");
    let (url, file) = (next()?, next()?);
    let mut problem: Value = serde_json::from_str(&fs::read_to_string(file)?)?;
    let client = Client::new(&url);
    for coefficient in arguments {
        problem["contacts"][0]["friction"]["coefficient"] = coefficient.parse::<f64>()?.into();
        let submission: types::Submission = serde_json::from_value(json!({ "problem": problem }))?;
        let job = client.create_job(None, Some("wait=30"), &submission).await?;
        let result = client.get_result(&job.id).await?;
        println!("{}", result.summary.normal_force);
    }
    // a filter by label is sent: left out, it would match every job, in a bulk deletion too
    let label = Map::from_iter([("label.study".to_owned(), "nobody's".into())]);
    let counted = client
        .count_jobs(None, None, None, None, None, None, Some(&label), None, None, None, None, None)
        .await?;
    assert_eq!(counted.total, 0, "{counted:?}");
    Ok(())
}
