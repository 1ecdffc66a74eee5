//! The command `signorini demo`: starts a service on a free port with a temporary store, and submits the five examples
//! to it over both protocols, as any client would.

use std::io::IsTerminal;

use anyhow::{Context, bail, ensure};
use app::App;
use base::{
    event::{Event, Payload},
    job::{Job, Status},
    run::Summary,
};
use eventsource_stream::Eventsource;
use futures_util::StreamExt;
use reqwest::Client;
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use service::config::{
    Config, Isolation, MemoryBudget, ProxyTrust, RetentionLimits, StoreFolder, Telemetry, Tls, Web,
};
use solver::solution::{ContactProfile, Iteration};
use tonic::transport::Channel;

use super::{client, examples, exit::Exit, output, report};

/// The name of the example whose stresses are printed.
const SHOWN: &str = "cylinder";
/// The number of places along the contact at which the stresses are printed.
const PLACES: usize = 21;

pub(super) async fn run() -> anyhow::Result<Exit> {
    let folder = tempfile::tempdir()?;
    let config = Config {
        listen: ([127, 0, 0, 1], 0).into(),
        store: StoreFolder {
            data: folder.path().to_path_buf(),
        },
        tls: Tls::default(),
        web: Web::default(),
        trust: ProxyTrust::default(),
        allow_unauthenticated: false,
        workers: 2,
        isolation: Isolation::Thread,
        max_queued: 100,
        max_queued_per_owner: 100,
        max_running_per_owner: None,
        max_bytes_per_owner: None,
        max_submissions_per_owner_per_minute: None,
        retention: RetentionLimits::default(),
        memory: MemoryBudget::default(),
        body_cache_bytes: None,
        max_body_bytes: 16 << 20,
        max_mesh_bytes: 16 << 20,
        max_connections: 100,
        max_received_bytes: 64 << 20,
        max_sent_bytes: 128 << 20,
        grace_s: 5,
        telemetry: Telemetry::default(),
    };
    let app = App::start(&config).await?;
    let shown = show(&app.url()).await;
    app.stop().await;
    shown
}

async fn show(url: &str) -> anyhow::Result<Exit> {
    output::print(&format!(
        "Service at {url}, REST and gRPC on one port, its store in a temporary folder.\n\n"
    ))?;
    let rest = Rest {
        client: client::local()?,
        url: url.to_string(),
    };
    let mut grpc = JobServiceClient::connect(url.to_string()).await?;

    // All ten jobs at once: two run at a time, the others wait in the queue.
    let mut jobs = vec![];
    for (name, text) in examples::ALL {
        jobs.push((
            name,
            rest.submit(name, text).await?,
            submit_grpc(&mut grpc, name, text).await?,
        ));
    }
    let mut shown = None;
    for (name, by_rest, by_grpc) in &jobs {
        rest.watch(by_rest, name)
            .await
            .with_context(|| format!("{name} over REST"))?;
        watch_grpc(&mut grpc, by_grpc, name)
            .await
            .with_context(|| format!("{name} over gRPC"))?;
        let summary = rest.get(&format!("/v1/jobs/{by_rest}/result")).await?["summary"].take();
        let result = grpc
            .get_result(pb::GetResultRequest {
                id: by_grpc.clone(),
            })
            .await?
            .into_inner();
        let digest = result.summary.unwrap_or_default().digest;
        ensure!(
            summary["digest"] == digest,
            "{name}: REST and gRPC differ: {} and {digest}",
            summary["digest"]
        );
        let summary: Summary = serde_json::from_value(summary)?;
        let solution = &summary.solution;
        let verdict = solution
            .accuracy
            .as_ref()
            .map_or("unknown", |a| a.verdict.in_words());
        output::print(&format!(
            "  {name:<18} both    same bits: {digest:.23}…\n  {:<18} accuracy {verdict}\n  {:<18} normal force {:.4}, \
             tangential force {:.4}\n\n",
            "", "", solution.normal_force, solution.tangential_force
        ))?;
        if *name == SHOWN {
            shown = Some((by_rest.clone(), summary));
        }
    }

    let (id, summary) = shown.with_context(|| format!("there is no example {SHOWN}"))?;
    for (boundary, contact) in &summary.solution.contacts {
        let path = format!("/v1/jobs/{id}/profiles/{boundary}?points={PLACES}");
        let profile: ContactProfile = serde_json::from_value(rest.get(&path).await?)?;
        output::print(&format!(
            "Stresses of {SHOWN} along {boundary:?}, at {PLACES} places:\n\n{}\n{}",
            report::profile(&profile),
            report::contact(boundary, contact, summary.solution.accuracy.as_ref())
        ))?;
    }
    Ok(Exit::Ok)
}

/// A minimal REST client.
struct Rest {
    client: Client,
    url: String,
}

impl Rest {
    async fn get(&self, path: &str) -> anyhow::Result<Value> {
        let response = self
            .client
            .get(format!("{}{path}", self.url))
            .send()
            .await?;
        let status = response.status();
        let body = response.json().await?;
        ensure!(status.is_success(), "GET {path}: {status}: {body}");
        Ok(body)
    }

    /// Submits a problem; returns the job's id.
    async fn submit(&self, name: &str, text: &str) -> anyhow::Result<String> {
        let problem: Value = serde_json::from_str(text)?;
        // solved on its own, so that there is something to watch and to compare
        let body =
            json!({ "problem": problem, "name": name, "labels": { "by": "rest" }, "cache": "off" });
        let response = self
            .client
            .post(format!("{}/v1/jobs", self.url))
            .json(&body)
            .send()
            .await?;
        let status = response.status();
        let job: Value = response.json().await?;
        ensure!(status.is_success(), "{name} was refused: {status}: {job:#}");
        Ok(job["id"].as_str().unwrap_or_default().to_string())
    }

    /// Follows a job to its end over server-sent events.
    async fn watch(&self, id: &str, name: &str) -> anyhow::Result<()> {
        let response = self
            .client
            .get(format!("{}/v1/jobs/{id}/events", self.url))
            .send()
            .await?;
        let mut events = response.error_for_status()?.bytes_stream().eventsource();
        let mut line = Line::new("REST", name);
        while let Some(event) = events.next().await {
            let event: Event = serde_json::from_str(&event?.data)?;
            match event.payload {
                Payload::Iteration(timed) => line.step(&timed.row)?,
                Payload::Done { job } => {
                    let Job {
                        status,
                        run_s,
                        failure,
                        ..
                    } = *job;
                    let failure = failure.map(|failure| failure.detail);
                    return line.end(status == Status::Succeeded, run_s, failure);
                }
                Payload::Status { .. }
                | Payload::Stage { .. }
                | Payload::Mesh { .. }
                | Payload::Warning(_) => {}
            }
        }
        bail!("the stream ended before the job")
    }
}

/// Submits a problem; returns the job's id.
async fn submit_grpc(
    grpc: &mut JobServiceClient<Channel>,
    name: &str,
    text: &str,
) -> anyhow::Result<String> {
    let problem = match files::parse(text) {
        Ok(problem) => pb::Problem::from(problem),
        Err(violations) => bail!("{name}: {violations:?}"),
    };
    let labels = [("by".to_string(), "grpc".to_string())].into();
    let request = pb::CreateJobRequest {
        problem: Some(problem),
        name: Some(name.into()),
        labels,
        cache: pb::Cache::Off.into(),
        ..Default::default()
    };
    Ok(grpc.create_job(request).await?.into_inner().id)
}

/// Follows a job to its end over WatchJob.
async fn watch_grpc(
    grpc: &mut JobServiceClient<Channel>,
    id: &str,
    name: &str,
) -> anyhow::Result<()> {
    use pb::event::Payload;
    let mut events = grpc
        .watch_job(pb::WatchJobRequest {
            id: id.into(),
            after_seq: 0,
        })
        .await?
        .into_inner();
    let mut line = Line::new("gRPC", name);
    while let Some(event) = events.message().await? {
        match event.payload {
            Some(Payload::Iteration(row)) => {
                line.step_by(row.k, &row.stage, row.residual, row.friction_residual)?
            }
            Some(Payload::Done(pb::DoneEvent { job })) => {
                let job = job.unwrap_or_default();
                let detail = job.failure.clone().map(|failure| failure.detail);
                return line.end(job.status() == pb::Status::Succeeded, job.run_s, detail);
            }
            _ => {}
        }
    }
    bail!("the stream ended before the job")
}

/// Prints the progress of one job: on a terminal one line that changes, otherwise a line for each iteration.
struct Line {
    head: String,
    last: String,
    iterations: u32,
    terminal: bool,
}

impl Line {
    fn new(protocol: &str, name: &str) -> Line {
        let terminal = std::io::stdout().is_terminal();
        Line {
            head: format!("  {name:<18} {protocol}"),
            last: String::new(),
            iterations: 0,
            terminal,
        }
    }

    fn step(&mut self, row: &Iteration) -> anyhow::Result<()> {
        self.step_by(
            row.k,
            row.stage.as_str(),
            row.residual,
            row.friction_residual,
        )
    }

    fn step_by(&mut self, k: u32, stage: &str, residual: f64, friction: f64) -> anyhow::Result<()> {
        self.iterations = k;
        self.last =
            format!("{k:>4} {stage:<12} residual {residual:8.2e}  friction {friction:8.2e}");
        let Line { head, last, .. } = self;
        output::print(&match self.terminal {
            // return to the start of the line, write, clear the rest
            true => format!("\r{head}{last}\x1b[K"),
            false => format!("{head}{last}\n"),
        })?;
        Ok(())
    }

    fn end(
        self,
        succeeded: bool,
        run_s: Option<f64>,
        failure: Option<String>,
    ) -> anyhow::Result<()> {
        let Line {
            head,
            last,
            iterations,
            terminal,
        } = self;
        if terminal {
            output::print(&format!("\r{head}{last}\x1b[K\n"))?;
        }
        ensure!(succeeded, "the job failed: {}", failure.unwrap_or_default());
        output::print(&format!(
            "{head}    converged after {iterations} iterations, {:.3} s\n",
            run_s.unwrap_or_default()
        ))?;
        Ok(())
    }
}
