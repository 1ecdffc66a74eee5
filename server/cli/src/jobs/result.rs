//! The command `signorini result`.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use base::{event::TimedIteration, run::Summary};
use clap::Args;
use files::plot::Plot;
use form_urlencoded::Serializer;
use reqwest::Response;
use serde::Deserialize;
use serde_json::{Value, json};
use service::{
    formats,
    verbs::{page::MAX_PAGE_SIZE, results::PARTIAL},
};
use solver::solution::ContactProfile;
use tokio::{runtime::Handle, task::block_in_place};

use super::{
    super::{
        exit::Exit,
        output::{self, Look, Output, Part, Profiles},
        report,
        service::{Connection, Service, misunderstood, segment},
    },
    id::Id,
    listing::Format,
};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini result job_…\n  signorini result job_… --profile -f csv > stresses.csv\n  \
    signorini result job_… -o punch.vtu -o punch.profile.svg\n  signorini result sweep_… -f csv > study.csv"
)]
pub(crate) struct Arguments {
    /// The job or the sweep
    id: Id,

    /// Print the stresses along the contact boundary; if there are several, along the one with this name
    #[arg(long, value_name = "BOUNDARY", num_args = 0..=1, default_missing_value = "")]
    profile: Option<String>,

    /// Print the iterations
    #[arg(long, conflicts_with = "profile")]
    history: bool,

    /// Points of the profile: all, nodes, friction, or a number of evenly spaced ones
    #[arg(long, value_name = "POINTS")]
    points: Option<String>,

    /// Load step of the profile, by its name or its number from 0 [default: the last]
    #[arg(long, value_name = "STEP")]
    step: Option<String>,

    /// Serve also the profile, history, fields and figures of a job that failed or was canceled: the state at which it
    /// stopped, which is not a solution
    #[arg(long)]
    partial: bool,

    /// How to print the result: csv and jsonl print the profile, unless --history is given
    #[arg(short, long, value_enum, default_value_t = Format::Table)]
    format: Format,

    /// Write a part of the result to this file, chosen by its name as for `signorini solve -o`: punch.csv, punch.history.csv,
    /// punch.summary.json, punch.vtu, punch.fields.npz, punch.svg, punch.convergence.svg; can be repeated
    #[arg(short, long, value_name = "OUT")]
    output: Vec<PathBuf>,

    #[command(flatten)]
    look: Look,

    #[command(flatten)]
    service: Connection,
}

/// The remark that is printed with a partial result.
pub(super) const IS_PARTIAL: &str =
    "signorini: the result is partial: the job has not ended, or did not converge";

/// The scalars of a result, as the service answers them.
#[derive(Deserialize)]
struct Scalars {
    summary: Summary,
    steps: Vec<Step>,
}

/// What of a problem says which bodies face its contacts; a newer service may send more.
#[derive(Deserialize)]
struct Faced {
    contacts: Vec<FacedContact>,
}

#[derive(Deserialize)]
struct FacedContact {
    against: Option<Boundary>,
}

#[derive(Deserialize)]
struct Boundary {
    boundary: String,
}

#[derive(Deserialize)]
struct Step {
    name: String,
    summary: solver::solution::Summary,
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let id = arguments.id;
    let base = id.path();
    if let Id::Sweep(_) = id {
        return of_sweep(&service, &base, &arguments).await;
    }
    let document: Value = service.get(&format!("{base}/result")).await?;
    let scalars: Scalars =
        serde_json::from_value(document.clone()).with_context(|| misunderstood("the result"))?;
    if document["result_available"] == "partial" {
        eprintln!("{IS_PARTIAL}");
    }
    let contacts: Vec<&str> = scalars
        .summary
        .solution
        .contacts
        .keys()
        .map(String::as_str)
        .collect();
    if !arguments.output.is_empty() {
        // all names are read before a file is written
        let profiles = profiles(&service, &base, &contacts).await?;
        let outputs = arguments.output.iter();
        let outputs = outputs.map(|path| Output::parse(path, &profiles));
        let outputs = match outputs.collect::<Result<Vec<_>, _>>() {
            Ok(outputs) => outputs,
            Err(problem) => {
                eprintln!("signorini: {problem}");
                return Ok(Exit::Invalid);
            }
        };
        let routes = outputs.iter().map(|output| arguments.route(output));
        let routes = match routes.collect::<Result<Vec<_>, _>>() {
            Ok(routes) => routes,
            Err(problem) => {
                eprintln!("signorini: {problem}");
                return Ok(Exit::Invalid);
            }
        };
        for (output, route) in outputs.iter().zip(routes) {
            let route = route.map(|route| format!("{base}/{route}"));
            save(&service, output, route, &document).await?;
        }
        return Ok(Exit::Ok);
    }
    let as_rows = matches!(arguments.format, Format::Csv | Format::Jsonl);
    let asked_for_profile =
        arguments.profile.is_some() || arguments.points.is_some() || arguments.step.is_some();
    if arguments.history {
        let format = of_rows(arguments.format);
        let path = format!("{base}/history?{}", arguments.query_of(format));
        let rows = |text: &str| -> anyhow::Result<String> {
            let rows: Vec<TimedIteration> = serde_json::from_str(text)?;
            Ok(rows
                .iter()
                .map(|timed| report::iteration(&timed.row) + "\n")
                .collect())
        };
        return print(&service, &path, arguments.format, rows).await;
    }
    if asked_for_profile || as_rows {
        let named = arguments.profile.as_deref().filter(|name| !name.is_empty());
        let boundary = match (named, contacts.as_slice()) {
            (Some(name), _) => name,
            (None, [only]) => only,
            (None, []) => bail!("the problem has no contact, and so no profile"),
            (None, several) => {
                eprintln!(
                    "signorini: name a contact boundary with --profile: {}",
                    several.join(", ")
                );
                return Ok(Exit::Invalid);
            }
        };
        let query = arguments.of_profile(of_rows(arguments.format));
        let path = format!("{base}/profiles/{}?{query}", segment(boundary));
        let columns = |text: &str| -> anyhow::Result<String> {
            let profile: ContactProfile = serde_json::from_str(text)?;
            Ok(report::profile(&profile))
        };
        return print(&service, &path, arguments.format, columns).await;
    }
    if arguments.format == Format::Json {
        output::print(&format!("{document:#}\n"))?;
        return Ok(Exit::Ok);
    }
    let steps = scalars
        .steps
        .iter()
        .map(|step| (step.name.as_str(), &step.summary));
    output::print(&report::result(None, &scalars.summary, steps))?;
    Ok(Exit::Ok)
}

/// The boundaries of a job that have a profile, of which the result names those of the contacts.
async fn profiles(service: &Service, base: &str, contacts: &[&str]) -> anyhow::Result<Profiles> {
    let problem: Faced = service.get(&format!("{base}/problem")).await?;
    let facing = problem.contacts.into_iter();
    let facing = facing.filter_map(|contact| contact.against);
    Ok(Profiles {
        contacts: contacts.iter().map(|name| (*name).to_owned()).collect(),
        facing: facing.map(|against| against.boundary).collect(),
    })
}

impl Arguments {
    /// The query of a request for a part of the result in this format.
    fn query_of(&self, format: &str) -> String {
        let mut query = Serializer::new(String::new());
        query.append_pair("format", format);
        query.extend_pairs(partial(self.partial));
        query.finish()
    }

    /// The query of a request for a profile.
    fn of_profile(&self, format: &str) -> String {
        let mut query = Serializer::new(self.query_of(format));
        query.extend_pairs(self.points.iter().map(|points| ("points", points)));
        query.extend_pairs(self.step.iter().map(|step| ("step", step)));
        query.finish()
    }

    /// The path below the job's path at which the service has the content of a file; `None`: the content is part of the
    /// result. The error names an invalid option.
    fn route(&self, output: &Output) -> Result<Option<String>, String> {
        let part = &output.part;
        let profile = matches!(part, Part::Profile(_));
        let stepped = profile || matches!(part, Part::Plot(Plot::Profile | Plot::Convergence));
        if self.step.is_some() && !stepped {
            return Err(
                "--step is for profiles, and for the figures profile and convergence".into(),
            );
        }
        if self.points.is_some() && !profile {
            return Err("--points is for profiles".into());
        }
        let format = output.format.name();
        Ok(match part {
            Part::Summary => None,
            Part::Everything => {
                let path = output.path.as_deref().unwrap_or(Path::new("-"));
                return Err(format!(
                    "-o {}: name the part before the extension: NAME.summary.json, or NAME.fields, NAME.profile or NAME.history with \
                     .json or .npz",
                    path.display()
                ));
            }
            Part::Profile(boundary) => {
                let query = self.of_profile(format);
                Some(format!("profiles/{}?{query}", segment(boundary)))
            }
            Part::History => Some(format!("history?{}", self.query_of(format))),
            Part::Fields => Some(format!("fields?{}", self.query_of(format))),
            Part::Plot(plot) => {
                let mut query = Serializer::new(self.look.query());
                query.extend_pairs(self.step.iter().map(|step| ("step", step)));
                query.extend_pairs(partial(self.partial));
                let (plot, query) = (plot.as_str(), query.finish());
                Some(format!("plots/{plot}.{format}?{query}"))
            }
        })
    }
}

/// The parameter that asks for the state of a job without a solution, if it is wanted. It is not sent otherwise, since a
/// service of an earlier version does not know it.
pub(super) fn partial(wanted: bool) -> Option<(&'static str, &'static str)> {
    wanted.then_some((PARTIAL.name, "true"))
}

/// The name of a format of rows in the service; a table is made from JSON.
fn of_rows(format: Format) -> &'static str {
    match format {
        Format::Table | Format::Json => "json",
        Format::Csv => "csv",
        Format::Jsonl => "jsonl",
    }
}

/// Prints the answer at this path as it arrives, or as a table.
async fn print(
    service: &Service,
    path: &str,
    format: Format,
    as_table: impl Fn(&str) -> anyhow::Result<String>,
) -> anyhow::Result<Exit> {
    let answer = service.fetch(path).await?;
    match format {
        Format::Table => {
            let text = answer
                .text()
                .await
                .map_err(|error| service.unreachable(&error))?;
            let table = as_table(&text).with_context(|| misunderstood("the answer"))?;
            output::print(&table)?;
        }
        Format::Json | Format::Jsonl | Format::Csv => {
            write(service, answer, &mut std::io::stdout())?
        }
    }
    Ok(Exit::Ok)
}

async fn of_sweep(service: &Service, base: &str, arguments: &Arguments) -> anyhow::Result<Exit> {
    if arguments.profile.is_some()
        || arguments.history
        || arguments.points.is_some()
        || arguments.step.is_some()
        || arguments.partial
    {
        eprintln!(
            "signorini: a sweep has only a table; for a profile, submit a member as a job of its own (POST …/members/N/job)"
        );
        return Ok(Exit::Invalid);
    }
    // all names are read before anything is fetched
    let formats = arguments
        .output
        .iter()
        .map(|path| super::super::sweep::format_of(path));
    let formats: Vec<formats::Format> = match formats.collect() {
        Ok(formats) => formats,
        Err(problem) => {
            eprintln!("signorini: {problem}");
            return Ok(Exit::Invalid);
        }
    };
    for (path, format) in arguments.output.iter().zip(formats) {
        let path = (path.as_os_str() != "-").then_some(path.as_path());
        table(service, base, format, path).await?;
    }
    if arguments.output.is_empty() {
        let format = match arguments.format {
            // the table of a sweep has many columns: it is for a program
            Format::Table | Format::Csv => formats::Format::Csv,
            Format::Jsonl => formats::Format::Jsonl,
            Format::Json => formats::Format::Json,
        };
        table(service, base, format, None).await?;
    }
    Ok(Exit::Ok)
}

/// Writes the table of a sweep to a file, or to standard output. JSON, too, has all members, although the service
/// returns it in pages.
async fn table(
    service: &Service,
    base: &str,
    format: formats::Format,
    path: Option<&Path>,
) -> anyhow::Result<()> {
    let route = format!("{base}/results?format={}", format.name());
    if format != formats::Format::Json {
        let answer = service.fetch(&route).await?;
        return match path {
            Some(path) => download(service, path, answer),
            None => write(service, answer, &mut std::io::stdout()),
        };
    }
    let (mut members, mut token) = (vec![], Some(String::new()));
    while let Some(at) = token {
        let mut query = Serializer::new(format!("&page_size={MAX_PAGE_SIZE}"));
        if !at.is_empty() {
            query.append_pair("page_token", &at);
        }
        let mut page: Page = service.get(&format!("{route}{}", query.finish())).await?;
        members.append(&mut page.members);
        token = page.next_page_token;
    }
    let text = format!("{:#}\n", json!({ "members": members }));
    match path {
        Some(path) => output::replace(path, |out| Ok(out.write_all(text.as_bytes())?))
            .with_context(|| format!("cannot write {}", path.display())),
        None => Ok(output::print(&text)?),
    }
}

/// A page of the table of a sweep.
#[derive(Deserialize)]
struct Page {
    members: Vec<Value>,
    next_page_token: Option<String>,
}

/// Writes one part of the result to its file; `route` is the path of the part in the service, `document` the result.
async fn save(
    service: &Service,
    output: &Output,
    route: Option<String>,
    document: &Value,
) -> anyhow::Result<()> {
    let Some(route) = route else {
        let text = format!("{:#}\n", document["summary"]);
        return match &output.path {
            Some(path) => output::replace(path, |out| Ok(out.write_all(text.as_bytes())?))
                .with_context(|| format!("cannot write {}", path.display())),
            None => Ok(output::print(&text)?),
        };
    };
    let answer = service.fetch(&route).await?;
    match &output.path {
        Some(file) => download(service, file, answer),
        None => write(service, answer, &mut std::io::stdout()),
    }
}

/// Writes an answer to a file, which appears when the whole answer has arrived.
pub(super) fn download(service: &Service, path: &Path, answer: Response) -> anyhow::Result<()> {
    output::replace(path, |out| write(service, answer, out))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Writes an answer piece by piece, since fields may be larger than the memory. This function blocks, as `replace`
/// does.
fn write(service: &Service, mut answer: Response, out: &mut dyn Write) -> anyhow::Result<()> {
    loop {
        let piece = block_in_place(|| Handle::current().block_on(answer.chunk()));
        match piece.map_err(|error| service.unreachable(&error))? {
            Some(piece) => match out.write_all(&piece) {
                // who read it has seen enough
                Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => return Ok(()),
                written => written?,
            },
            None => return Ok(out.flush()?),
        }
    }
}
