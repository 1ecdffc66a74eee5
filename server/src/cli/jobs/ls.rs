//! The command `signorini ls`.

use clap::Args;
use form_urlencoded::Serializer;
use serde_json::Value;

use super::{
    super::{exit::Exit, service::Connection},
    listing::{Found, Shown},
    submit::label,
};
use crate::job::Status;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  signorini ls --status queued,running\n  \
    signorini ls --label study=radius -n 0 -f csv > study.csv\n  signorini rm $(signorini ls --status failed -q)")]
pub(in crate::cli) struct Arguments {
    /// List sweeps instead of jobs
    #[arg(long, conflicts_with_all = ["status", "name", "owner", "labels", "sweep"])]
    sweeps: bool,

    /// List only jobs with this status: queued, running, succeeded, failed, canceled; can be repeated, or a list with
    /// commas
    #[arg(long, value_delimiter = ',', value_name = "STATUS", value_parser = status)]
    status: Vec<Status>,

    /// List only jobs with this name
    #[arg(long)]
    name: Option<String>,

    /// List only jobs of this owner
    #[arg(long)]
    owner: Option<String>,

    /// List only jobs with this label; can be repeated
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = label)]
    labels: Vec<(String, String)>,

    /// List only the jobs of this sweep
    #[arg(long, value_name = "ID")]
    sweep: Option<String>,

    /// List at most this many, the newest first; 0: all
    #[arg(short = 'n', long, default_value_t = 20, value_name = "N")]
    limit: usize,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

fn status(text: &str) -> Result<Status, String> {
    text.parse()
        .map_err(|_| "expected queued, running, succeeded, failed or canceled".into())
}

/// The largest page that the service gives.
const PAGE: usize = 1000;

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let most = match arguments.limit {
        0 => usize::MAX,
        some => some,
    };
    let list = match arguments.sweeps {
        true => "sweeps",
        false => "jobs",
    };
    let (mut found, mut page): (Vec<Value>, Option<String>) = (vec![], None);
    loop {
        let mut query = Serializer::new(String::new());
        for status in &arguments.status {
            query.append_pair("status", (*status).into());
        }
        for (name, value) in [
            ("name", &arguments.name),
            ("owner", &arguments.owner),
            ("sweep", &arguments.sweep),
        ] {
            query.extend_pairs(value.iter().map(|value| (name, value)));
        }
        for (key, value) in &arguments.labels {
            query.append_pair(&format!("label.{key}"), value);
        }
        query.append_pair("page_size", &(most - found.len()).min(PAGE).to_string());
        query.extend_pairs(page.iter().map(|token| ("page_token", token)));
        let mut answer: Value = service
            .get(&format!("/v1/{list}?{}", query.finish()))
            .await?;
        if let Value::Array(entries) = answer[list].take() {
            found.extend(entries);
        }
        page = answer["next_page_token"].as_str().map(str::to_owned);
        if page.is_none() || found.len() >= most {
            break;
        }
    }
    if found.is_empty() && arguments.shown.is_table() {
        eprintln!("there are no such {list}");
        return Ok(Exit::Ok);
    }
    arguments.shown.print(&Found::Many(found))?;
    Ok(Exit::Ok)
}
