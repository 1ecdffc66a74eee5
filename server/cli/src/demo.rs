//! The command `signorini demo`: starts a service on a free port with a temporary store, and submits the five examples
//! to it over both protocols, as any client would. It ends with their verdicts, a figure, and what to do next.

use std::io::IsTerminal;

use anyhow::{Context, bail, ensure};
use app::App;
use base::job::{Job, JobId};
use reqwest::Method;
use rpc::pb::{self, job_service_client::JobServiceClient};
use serde_json::{Value, json};
use service::config::{
    Config, Isolation, MemoryBudget, Placement, ProxyTrust, RetentionLimits, StoreFolder,
    Telemetry, Tls, WEEK_S, Web,
};
use tonic::transport::Channel;

use super::{examples, exit::Exit, jobs, output, report, service::Service};

/// The name of the example whose stresses are drawn.
const SHOWN: &str = "cylinder";

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
        lease_s: 30,
        isolation: Isolation::Thread,
        max_queued: 100,
        max_queued_per_owner: 100,
        max_running_per_owner: None,
        max_timeout_s: WEEK_S,
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
        placement: Placement::default(),
        telemetry: Telemetry::default(),
    };
    let app = App::start(&config).await?;
    let shown = show(&app.url()).await;
    app.stop().await;
    shown
}

async fn show(url: &str) -> anyhow::Result<Exit> {
    output::print(&format!(
        "A temporary service runs at {url}, REST and gRPC on one port. It solves five contact problems of a thesis, each \
         submitted over both protocols: a rigid obstacle is pressed into an elastic body and dragged along it.\n\n"
    ))?;
    let rest = Service::local(url)?;
    let mut grpc = JobServiceClient::connect(url.to_string()).await?;

    // All ten jobs at once: two run at a time, the others wait in the queue.
    let mut jobs = vec![];
    for (name, text) in examples::ALL {
        jobs.push((
            name,
            submit_rest(&rest, name, text).await?,
            submit_grpc(&mut grpc, name, text).await?,
        ));
    }
    let (mut shown, mut iterations) = (None, 0);
    for (number, (name, by_rest, by_grpc)) in jobs.iter().enumerate() {
        progress(&format!("  {} of {}: {name} …", number + 1, jobs.len()))?;
        let of_rest = async {
            let job = jobs::follow::ended(&rest, *by_rest).await?;
            let result: Value = rest.get(&format!("/v1/jobs/{by_rest}/result")).await?;
            anyhow::Ok((job, result))
        };
        let (job, result) = of_rest.await.with_context(|| format!("{name} over REST"))?;
        let digest = ended_over_grpc(&mut grpc, by_grpc)
            .await
            .with_context(|| format!("{name} over gRPC"))?;
        ensure!(
            result["summary"]["digest"] == digest,
            "{name}: REST and gRPC differ: {} and {digest}",
            result["summary"]["digest"]
        );
        iterations += job.progress.as_ref().map_or(0, |made| made.iteration);
        let headline = report::headline(&job).unwrap_or_default();
        progress("")?;
        output::print(&format!("  {name:<18} {headline}\n"))?;
        if *name == SHOWN {
            shown = Some((*by_rest, result));
        }
    }
    output::print(&format!(
        "\nThe verdict says how far a result can be trusted, and ± how much of each number the mesh leaves open. These \
         meshes were\nrefined until that was small enough. Both protocols gave the same bits, after {iterations} iterations in all.\n\n"
    ))?;

    let (id, result) = shown.with_context(|| format!("there is no example {SHOWN}"))?;
    let figures = jobs::plot::profile_charts(&rest, id, result).await?;
    output::print(&format!(
        "The {SHOWN}: where σ_t is smaller than its bound the body sticks to the obstacle, elsewhere it slips.\n\n{figures}\n{NEXT}"
    ))?;
    Ok(Exit::Ok)
}

/// What to do after the demo.
const NEXT: &str = "What to do next

  signorini solve problem.json -o punch.svg      solve a problem without a service, and draw it
  signorini serve                                start a service that stays, at http://127.0.0.1:8080
  signorini submit problem.json --watch          send it a problem, and watch it converge
  signorini schema                               all fields of a problem, with their meaning

`signorini examples FOLDER` writes the five problems, docs/tutorial.md leads from here to a figure of a study.
";

/// Shows on a terminal which job is waited for, in a line that the next one replaces.
fn progress(text: &str) -> anyhow::Result<()> {
    if std::io::stdout().is_terminal() {
        // return to the start of the line, write, clear the rest
        output::print(&format!("\r{text}\x1b[K"))?;
    }
    Ok(())
}

/// Submits a problem; returns the job's id.
async fn submit_rest(service: &Service, name: &str, text: &str) -> anyhow::Result<JobId> {
    let problem: Value = serde_json::from_str(text)?;
    // solved on its own, so that there is something to compare
    let body =
        json!({ "problem": problem, "name": name, "labels": { "by": "rest" }, "cache": "off" });
    let request = service.request(Method::POST, "/v1/jobs").json(&body);
    let job: Job = service.document(service.send(request).await?).await?;
    Ok(job.id)
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

/// Follows a job to its end over WatchJob; returns the digest of its result.
async fn ended_over_grpc(grpc: &mut JobServiceClient<Channel>, id: &str) -> anyhow::Result<String> {
    let request = pb::WatchJobRequest {
        id: id.into(),
        after_seq: 0,
    };
    let mut events = grpc.watch_job(request).await?.into_inner();
    while let Some(event) = events.message().await? {
        let Some(pb::event::Payload::Done(pb::DoneEvent { job })) = event.payload else {
            continue;
        };
        let job = job.unwrap_or_default();
        let detail = job.failure.clone().map(|failure| failure.detail);
        ensure!(
            job.status() == pb::Status::Succeeded,
            "the job failed: {}",
            detail.unwrap_or_default()
        );
        let request = pb::GetResultRequest { id: id.into() };
        let result = grpc.get_result(request).await?.into_inner();
        return Ok(result.summary.unwrap_or_default().digest);
    }
    bail!("the stream ended before the job")
}
