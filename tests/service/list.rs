//! GET /v1/jobs, and /v1/jobs/table.

use reqwest::StatusCode;
use serde_json::{Value, json};
use suite::{example_json, harness::large};

use crate::{SIGNORINI, server};

/// Operations: ListJobs
#[tokio::test]
async fn pages_contain_every_job_once_newest_first() {
    let server = server().await;
    let mut ids = vec![];
    for _ in 0..7 {
        ids.push(server.submit(&example_json("sheet")).await);
    }
    ids.reverse();
    let (mut seen, mut token) = (vec![], String::new());
    loop {
        let page = server
            .json(&format!("/v1/jobs?page_size=3&page_token={token}"))
            .await;
        let jobs = page["jobs"].as_array().unwrap();
        assert!(jobs.len() <= 3);
        seen.extend(
            jobs.iter()
                .map(|job| job["id"].as_str().unwrap().to_string()),
        );
        match page["next_page_token"].as_str() {
            Some(next) => token = next.to_string(),
            None => break,
        }
    }
    assert_eq!(seen, ids);
}

/// Operations: ListJobs
#[tokio::test]
async fn jobs_are_found_by_status_with_their_queue_positions() {
    let server = suite::harness::Server::start_alone(SIGNORINI, &["--workers", "1"]).await;
    let front = server.submit(&large()).await;
    server.until_running(&front).await;
    let waiting = [
        server.submit(&example_json("sheet")).await,
        server.submit(&example_json("sheet")).await,
    ];
    let ids = async |query: &str| -> Vec<String> {
        let page = server.json(&format!("/v1/jobs?{query}")).await;
        page["jobs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|job| job["id"].as_str().unwrap().to_string())
            .collect()
    };
    assert_eq!(ids("status=running").await, [front.as_str()]);
    assert_eq!(
        ids("status=queued").await,
        [waiting[1].as_str(), waiting[0].as_str()]
    );
    assert_eq!(ids("status=queued,running").await.len(), 3);
    assert_eq!(ids("status=queued&status=running").await.len(), 3);
    assert_eq!(ids("status=failed").await.len(), 0);
    let queue = server.job(&waiting[1]).await["queue"].take();
    assert_eq!(
        (queue["position"].as_i64(), queue["ahead"].as_i64()),
        (Some(2), Some(1))
    );
    assert_eq!(queue["reason"], "workers_busy");
    // A token belongs to its list.
    let page = server.json("/v1/jobs?status=queued&page_size=1").await;
    let token = page["next_page_token"].as_str().unwrap();
    let other = server
        .get(&format!(
            "/v1/jobs?status=running&page_size=1&page_token={token}"
        ))
        .send()
        .await
        .unwrap();
    assert_eq!(other.status(), StatusCode::BAD_REQUEST);
    assert_eq!(
        other.json::<Value>().await.unwrap()["code"],
        "bad-page-token"
    );
}

/// Operations: GetJobTable
#[tokio::test]
async fn many_jobs_are_one_table_in_every_format_of_tables() {
    let server = server().await;
    let mut ids = vec![];
    for number in 0..5 {
        let mut problem = example_json("rectangular_punch");
        problem["contacts"][0]["indentation"] = json!(0.1 + 0.01 * f64::from(number));
        let name = format!("=cmd|{number}, \"x\"");
        let body =
            json!({ "problem": problem, "name": name, "labels": { "n": number.to_string() } });
        let job = server.solve(&body).await;
        assert_eq!(job["status"], "succeeded", "{job:#}");
        ids.push(job["id"].as_str().unwrap().to_owned());
    }
    let mut problem = example_json("rectangular_punch");
    problem["solver"] = json!({ "max_iterations": 3 });
    let failed = server
        .solve(&json!({ "problem": problem, "name": "failed" }))
        .await;
    assert_eq!(failed["reason"], "not_converged");

    // as JSON, in pages of two
    let (mut rows, mut token) = (vec![], String::new());
    loop {
        let path = format!("/v1/jobs/table?page_size=2&page_token={token}&order_by=created_at asc");
        let page = server.get(&path).send().await.unwrap();
        let header = page.headers().get("next-page-token").cloned();
        let page: Value = page.json().await.unwrap();
        assert_eq!(page["columns"][0], "id");
        let of_page = page["rows"].as_array().unwrap();
        assert!(of_page.len() <= 2);
        rows.extend(of_page.clone());
        let next = page["next_page_token"].as_str();
        assert_eq!(header.as_ref().map(|header| header.to_str().unwrap()), next);
        match next {
            Some(next) => token = next.to_owned(),
            None => break,
        }
    }
    assert_eq!(rows.len(), 6);
    for (row, id) in rows.iter().zip(&ids) {
        let summary = &server.json(&format!("/v1/jobs/{id}/result")).await["summary"];
        let job = server.job(id).await;
        assert_eq!((&row["id"], &row["name"]), (&json!(id), &job["name"]));
        assert_eq!(
            row["normal_force"],
            summary["contacts"]["top"]["normal_force"]
        );
        assert!(row["normal_force_error"].as_f64().unwrap() > 0.0);
        assert_eq!(
            (&row["verdict"], &row["contacts"]),
            (&job["verdict"], &json!("top"))
        );
    }
    let last = &rows[5];
    assert_eq!(
        (&last["status"], &last["reason"]),
        (&json!("failed"), &json!("not_converged"))
    );
    assert_eq!(last["normal_force"], Value::Null, "that of no solution");
    let asked = server.json("/v1/jobs/table?partial=true&name=failed").await;
    assert!(asked["rows"][0]["normal_force"].is_f64(), "{asked:#}");

    // in the other formats, with the columns that were asked for
    let path = "/v1/jobs/table?label.n=3&columns=label.n,normal_force.top,name,iterations,normal_force.left";
    let csv = server
        .get(path)
        .header("accept", "text/csv")
        .send()
        .await
        .unwrap();
    assert_eq!(csv.headers()["content-type"], "text/csv; charset=utf-8");
    assert_eq!(
        csv.headers()["content-disposition"],
        "attachment; filename=\"jobs.csv\""
    );
    let tag = csv.headers()["etag"].clone();
    let csv = csv.text().await.unwrap();
    let force = rows[3]["normal_force"].as_f64().unwrap();
    let made = server.job(&ids[3]).await["progress"]["iteration"].clone();
    let name = "\"'=cmd|3, \"\"x\"\"\"";
    assert_eq!(
        csv,
        format!(
            "label.n,normal_force.top,name,iterations,normal_force.left\r\n3,{force:?},{name},{made},\r\n"
        )
    );
    let known = server
        .get(path)
        .header("accept", "text/csv")
        .header("if-none-match", tag);
    assert_eq!(
        known.send().await.unwrap().status(),
        StatusCode::NOT_MODIFIED
    );
    for (format, start) in [
        ("jsonl", &b"{\"label.n\":\"3\","[..]),
        ("arrow", b"ARROW1"),
        ("npz", b"PK"),
    ] {
        let found = server
            .get(&format!("{path}&format={format}"))
            .send()
            .await
            .unwrap();
        assert_eq!(found.status(), StatusCode::OK, "{format}");
        assert!(found.bytes().await.unwrap().starts_with(start), "{format}");
    }
    let empty = server.json("/v1/jobs/table?name=nobody's").await;
    assert_eq!(
        (&empty["rows"], &empty["next_page_token"]),
        (&json!([]), &Value::Null)
    );
}

/// Operations: GetJobTable
#[tokio::test]
async fn an_unknown_column_is_refused_with_all_that_there_are() {
    let server = server().await;
    for (query, code, told) in [
        (
            "columns=id,colour",
            "bad-parameter",
            "peak_tangential_stress, indentation, tangential_displacement, tilt, label.KEY",
        ),
        ("columns=", "bad-parameter", "stored_bytes, labels"),
        ("columns=id,id", "bad-parameter", "each once"),
        ("page_size=1001", "bad-parameter", "1 to 1000"),
        ("page_token=x", "bad-page-token", "start again"),
        ("colour=red", "unknown-parameter", "columns"),
        (
            "format=vtu",
            "not-acceptable",
            "json, csv, jsonl, arrow, npz",
        ),
        ("partial=perhaps", "bad-parameter", "false or true"),
        ("status=lost", "bad-parameter", "queued"),
    ] {
        let refused = server.get(&format!("/v1/jobs/table?{query}"));
        let error: Value = refused.send().await.unwrap().json().await.unwrap();
        assert_eq!(error["code"], code, "{query}: {error:#}");
        assert!(
            error["detail"].as_str().unwrap().contains(told),
            "{query}: {error:#}"
        );
    }
}

/// A row is never left out without a word.
/// Operations: GetJobTable
#[tokio::test]
async fn a_damaged_job_is_an_error_of_the_table_as_of_the_list() {
    let mut server = server().await;
    let id = server.submit(&example_json("sheet")).await;
    server.until_done(&id).await;
    assert_eq!(
        server.json("/v1/jobs/table").await["rows"][0]["id"],
        json!(id)
    );
    server.kill().await;
    let database = std::fs::read_dir(server.data())
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let database = database.filter(|path| path.extension().is_some_and(|ending| ending == "db"));
    let database = rusqlite::Connection::open(database.last().unwrap()).unwrap();
    database
        .execute("update job set name = 'another'", ())
        .unwrap();
    drop(database);
    server.restart().await;
    for path in ["/v1/jobs", "/v1/jobs/table", "/v1/jobs/table?format=csv"] {
        let answer = server.get(path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::INTERNAL_SERVER_ERROR, "{path}");
        let error: Value = answer.json().await.unwrap();
        assert_eq!(error["code"], "corrupt-data", "{path}: {error:#}");
    }
}
