//! The command `signorini submit`.

use std::{collections::BTreeMap, path::PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use serde_json::value::{RawValue, to_raw_value};

use super::{
    super::{
        exit::Exit,
        service::{Connection, new_key},
    },
    file::{Kind, Submitted},
    id::Id,
    listing::{Found, Shown},
    wait, watch,
};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini submit examples/rectangular_punch.json --watch\n  \
    signorini submit study/*.json --label study=radius -q > ids.txt\n  \
    signorini submit examples/sweeps/stick_width.json\n\n\
    A submission that is repeated because its answer was lost creates no second job."
)]
pub(crate) struct Arguments {
    /// Problems or sweeps: JSON files, decks of Abaqus or CalculiX (.inp), or - for standard input. A file may also be
    /// a whole request, with `problem`, name, labels and limits
    #[arg(required = true)]
    files: Vec<PathBuf>,

    /// A name for people
    #[arg(long)]
    name: Option<String>,

    /// A label for programs, as KEY=VALUE; can be repeated
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = label)]
    labels: Vec<(String, String)>,

    /// Jobs of higher priority run first: -10 to 10; above 0 for administrators
    #[arg(long, allow_hyphen_values = true, value_name = "N")]
    priority: Option<i32>,

    /// The most seconds that the job may run
    #[arg(long, value_name = "SECONDS")]
    timeout: Option<f64>,

    /// The most seconds that the job may wait in the queue
    #[arg(long, value_name = "SECONDS")]
    queue_ttl: Option<f64>,

    /// Whether an earlier result of the same problem may be the answer
    #[arg(long, value_enum)]
    cache: Option<Cache>,

    /// The idempotency key: a submission with the same key returns what the first submission has created
    #[arg(long, value_name = "KEY")]
    key: Option<String>,

    /// Wait until all jobs and sweeps have ended; the exit code is that of `signorini wait`
    #[arg(long)]
    wait: bool,

    /// Print the iterations while the job runs, for one file
    #[arg(long, conflicts_with_all = ["wait", "format", "quiet"])]
    watch: bool,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Cache {
    /// An earlier result may be used
    Use,
    /// The problem is solved again, and its result may be used by later jobs
    Refresh,
    /// The problem is solved again, and its result is not used by other jobs
    Off,
}

/// Reads a label `KEY=VALUE`.
pub(super) fn label(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').filter(|(key, _)| !key.is_empty());
    let (key, value) = parts.ok_or("expected KEY=VALUE, such as study=radius")?;
    Ok((key.to_owned(), value.to_owned()))
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let Arguments { files, shown, .. } = &arguments;
    for (alone, what) in [
        (arguments.watch, "--watch"),
        (arguments.key.is_some(), "--key"),
    ] {
        if alone && files.len() > 1 {
            eprintln!(
                "signorini: {what} is for one file, and there are {}",
                files.len()
            );
            return Ok(Exit::Invalid);
        }
    }
    let service = arguments.service.open()?;
    // all are read before the first is submitted: a name that is misspelt leaves no half of a study behind
    let mut submissions = vec![];
    for file in files {
        let mut submitted = Submitted::read(file)?;
        arguments.add_to(&mut submitted)?;
        submissions.push(submitted);
    }
    let mut documents = vec![];
    for submitted in &submissions {
        let key = arguments.key.clone();
        let key = key.unwrap_or_else(new_key);
        let path = match submitted.kind {
            Kind::Job => "/v1/jobs",
            Kind::Sweep => "/v1/sweeps",
        };
        match service.submit(path, Some(submitted.body()?), &key).await {
            Ok(document) => documents.push(document),
            Err(error) => {
                if let [first, rest @ ..] = &files[documents.len()..]
                    && files.len() > 1
                {
                    let mut told = format!("signorini: stopped at {}", first.display());
                    if !rest.is_empty() {
                        let rest = rest.iter().map(|file| file.display().to_string());
                        told += &format!("; not submitted: {}", rest.collect::<Vec<_>>().join(" "));
                    }
                    eprintln!("{told}");
                }
                if !documents.is_empty() {
                    // what was accepted is not lost, whatever became of the rest
                    shown.print(&Found::Many(documents))?;
                }
                return Err(submitted.refused(error));
            }
        }
    }
    let ids = documents
        .iter()
        .map(|one| one["id"].as_str().unwrap_or_default().parse());
    let ids: Vec<Id> = ids.collect::<Result<_, _>>().map_err(anyhow::Error::msg)?;
    match (arguments.watch, ids.as_slice()) {
        (true, [id]) => {
            eprintln!("{id}");
            return watch::follow(&service, *id, watch::Format::Table).await;
        }
        _ if arguments.wait => {
            ids.iter().for_each(|id| eprintln!("{id}"));
            return wait::all(&service, &ids, None, shown).await;
        }
        _ => shown.print(&Found::of(documents))?,
    }
    Ok(Exit::Ok)
}

impl Arguments {
    /// Puts the options into the request; an option replaces the value that the file has for it.
    fn add_to(&self, submitted: &mut Submitted) -> anyhow::Result<()> {
        let fields = &mut submitted.fields;
        let mut set = |name: &str, value: Box<RawValue>| fields.insert(name.into(), value);
        if let Some(name) = &self.name {
            set("name", to_raw_value(name)?);
        }
        if let Some(priority) = self.priority {
            set("priority", to_raw_value(&priority)?);
        }
        if let Some(cache) = self.cache.and_then(|cache| cache.to_possible_value()) {
            if submitted.kind == Kind::Sweep {
                bail!("--cache is for problems: members of a sweep are always solved");
            }
            set("cache", to_raw_value(cache.get_name())?);
        }
        if !self.labels.is_empty() {
            let mut labels: BTreeMap<String, String> =
                object(fields.get("labels").map(|raw| &**raw))?;
            labels.extend(self.labels.iter().cloned());
            fields.insert("labels".into(), to_raw_value(&labels)?);
        }
        let limits = [("timeout_s", self.timeout), ("queue_ttl_s", self.queue_ttl)];
        if limits.iter().any(|(_, seconds)| seconds.is_some()) {
            let mut both: BTreeMap<String, f64> = object(fields.get("limits").map(|raw| &**raw))?;
            for (name, seconds) in limits {
                both.extend(seconds.map(|seconds| (name.to_owned(), seconds)));
            }
            fields.insert("limits".into(), to_raw_value(&both)?);
        }
        Ok(())
    }
}

/// Reads the object in the request to which an option adds an entry; empty if the request has none.
fn object<T: serde::de::DeserializeOwned>(
    found: Option<&RawValue>,
) -> anyhow::Result<BTreeMap<String, T>> {
    match found {
        Some(raw) => serde_json::from_str(raw.get()).with_context(|| {
            format!(
                "the option cannot be combined with the value in the file: {}",
                raw.get()
            )
        }),
        None => Ok(BTreeMap::new()),
    }
}
