//! The command `signorini plot`: figures in the terminal, or as files.

use std::{
    io::IsTerminal,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::Context;
use base::{event::TimedIteration, job::JobId};
use clap::Args;
use files::plot::{Plot, ProfileView};
use serde_json::Value;
use service::{formats::Format, verbs::results::RESULT_AVAILABLE};
use solver::solution::{ContactProfile, Summary};

use super::{
    super::{
        exit::Exit,
        output,
        service::{Connection, Service, misunderstood, segment},
    },
    chart::{Chart, Curve, Scale},
    id::Id,
    result::{IS_PARTIAL, download, partial},
};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini plot job_…\n  signorini plot job_… deformed -o punch.pdf --size column\n  \
    signorini plot job_… profile --step 2\n  signorini plot job_… mesh --open"
)]
pub(crate) struct Arguments {
    /// The job
    id: Id,

    /// The figure: profile, convergence, mesh or deformed; without it profile and convergence. Only these two are drawn
    /// in the terminal
    plot: Option<Plot>,

    /// Write the figure to this file instead: .svg, .png or .pdf
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,

    /// Open the figure with the program that this machine uses for such a file
    #[arg(long)]
    open: bool,

    /// Draw the state at the end of this load step, given by its name or its number from 0 [default: the last]
    #[arg(long)]
    step: Option<String>,

    /// The stress that the figure deformed shows [default: von_mises]
    #[arg(long, value_parser = ["von_mises", "xx", "yy", "zz", "xy"])]
    stress: Option<String>,

    /// Draw also a job that failed or was canceled: the state at which it stopped, which is not a solution
    #[arg(long)]
    partial: bool,

    #[command(flatten)]
    look: output::Look,

    #[command(flatten)]
    service: Connection,
}

/// The width and height of a figure in characters if the output is no terminal.
const SIZE: (u16, u16) = (80, 18);

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let Id::Job(id) = arguments.id else {
        eprintln!(
            "signorini: a sweep has no figure: `signorini result {}` prints its table",
            arguments.id
        );
        return Ok(Exit::Invalid);
    };
    if arguments.stress.is_some() && arguments.plot != Some(Plot::Deformed) {
        eprintln!("signorini: --stress is for the figure deformed");
        return Ok(Exit::Invalid);
    }
    let service = arguments.service.open()?;
    let drawn = matches!(
        arguments.plot,
        None | Some(Plot::Profile | Plot::Convergence)
    );
    if arguments.output.is_some() || arguments.open || !drawn {
        let plot = arguments.plot.unwrap_or(Plot::Profile);
        let name = <&str>::from(plot);
        let path = match &arguments.output {
            Some(path) => path.clone(),
            None if arguments.open => {
                // a name that nobody could have prepared: the folder is everybody's
                let mut builder = tempfile::Builder::new();
                builder.prefix("signorini-").suffix(".svg");
                let (_, path) = builder.tempfile()?.keep()?;
                path
            }
            None => {
                eprintln!(
                    "signorini: {name} cannot be drawn in a terminal: write it with -o FILE.svg, or open it with --open"
                );
                return Ok(Exit::Invalid);
            }
        };
        let ending = path.extension().unwrap_or_default();
        let mut formats = Format::OF_FIGURES.iter();
        let Some(format) = formats.find(|format| ending.eq_ignore_ascii_case(format.name())) else {
            eprintln!(
                "signorini: -o {}: the file must have one of the extensions {}",
                path.display(),
                Format::endings(Format::OF_FIGURES)
            );
            return Ok(Exit::Invalid);
        };
        let look = arguments.look.query();
        let mut more = form_urlencoded::Serializer::new(String::new());
        more.extend_pairs(arguments.step.iter().map(|step| ("step", step)));
        more.extend_pairs(arguments.stress.iter().map(|stress| ("stress", stress)));
        more.extend_pairs(partial(arguments.partial));
        let (format, more) = (format.name(), more.finish());
        let route = format!("/v1/jobs/{id}/plots/{name}.{format}?{look}&{more}");
        let route = route.trim_end_matches('&');
        let answer = service.fetch(route).await?;
        let available = answer.headers().get(RESULT_AVAILABLE);
        if available.is_some_and(|available| available == "partial") {
            eprintln!("{IS_PARTIAL}");
        }
        download(&service, &path, answer)?;
        eprintln!("{}", path.display());
        if arguments.open {
            open(&path)?;
        }
        return Ok(Exit::Ok);
    }
    let mut figures = vec![];
    let mut step = None;
    // a job without a result has iterations all the same
    if arguments.plot != Some(Plot::Convergence) || arguments.step.is_some() {
        let result: Value = service.get(&format!("/v1/jobs/{id}/result")).await?;
        if result["result_available"] == "partial" {
            eprintln!("{IS_PARTIAL}");
        }
        if let Some(wanted) = &arguments.step {
            step = number_of_step(&result, wanted);
            if step.is_none() {
                eprintln!("signorini: {}", no_step(&result, id, wanted));
                return Ok(Exit::NotFound);
            }
        }
        if arguments.plot != Some(Plot::Convergence) {
            figures.extend(profiles(&service, id, result, step, arguments.partial).await?);
        }
    }
    if arguments.plot != Some(Plot::Profile) {
        figures.push(convergence(&service, id, step, arguments.partial).await?);
    }
    output::print(&draw_all(&figures))?;
    Ok(Exit::Ok)
}

/// Draws the stresses along each contact boundary of a job for a terminal, as the command does. `result`: its result.
pub(crate) async fn profile_charts(
    service: &Service,
    id: JobId,
    result: Value,
) -> anyhow::Result<String> {
    Ok(draw_all(&profiles(service, id, result, None, false).await?))
}

/// Draws figures below each other, as wide as the terminal.
pub(super) fn draw_all(figures: &[Chart]) -> String {
    let in_colour = std::io::stdout().is_terminal()
        && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let width = console::Term::stdout()
        .size_checked()
        .map_or(SIZE.0, |(_, columns)| columns.clamp(40, 120));
    let text: Vec<String> = figures
        .iter()
        .map(|figure| figure.draw(width, SIZE.1, in_colour))
        .collect();
    text.join("\n")
}

/// The number of a load step that is given by its name or its number; `None` if there is no such step. A problem
/// without load steps has step 0.
fn number_of_step(result: &Value, wanted: &str) -> Option<u32> {
    let names = names_of_steps(result);
    let number = names.iter().position(|name| *name == wanted);
    let number = number.or_else(|| wanted.parse().ok());
    let number = number.filter(|number| *number < names.len().max(1));
    number.and_then(|number| u32::try_from(number).ok())
}

/// The message that a job has no such load step, with the names of the existing steps.
fn no_step(result: &Value, id: JobId, wanted: &str) -> String {
    let names = names_of_steps(result);
    if names.is_empty() {
        format!("{id} has no load steps; remove --step")
    } else {
        format!(
            "{id} has no load step {wanted:?}; it has, by name or by number from 0: {}",
            names.join(", ")
        )
    }
}

fn names_of_steps(result: &Value) -> Vec<&str> {
    let steps = result["steps"].as_array().into_iter().flatten();
    steps.filter_map(|step| step["name"].as_str()).collect()
}

/// Makes charts of the stresses along each contact boundary at the end of load step `step`, or of the last step, with
/// the range that figures have. `wanted`: whether the state of a job without a solution will do.
pub(super) async fn profiles(
    service: &Service,
    id: JobId,
    mut result: Value,
    step: Option<u32>,
    wanted: bool,
) -> anyhow::Result<Vec<Chart>> {
    // a load step that has ended is what it is, whatever became of the job
    let state = match step {
        None if result["result_available"] == "partial" => " (partial: no solution)",
        _ => "",
    };
    let of_step = step.and_then(|number| result["steps"].get_mut(number as usize));
    let summary = match of_step {
        Some(step) => step["summary"].take(),
        None => result["summary"].take(),
    };
    let summary: Summary =
        serde_json::from_value(summary).with_context(|| misunderstood("the result"))?;
    let mut figures = vec![];
    for boundary in summary.contacts.keys() {
        let mut query = form_urlencoded::Serializer::new("format=json".to_owned());
        query.extend_pairs(step.map(|number| ("step", number.to_string())));
        query.extend_pairs(partial(wanted));
        let path = format!(
            "/v1/jobs/{id}/profiles/{}?{}",
            segment(boundary),
            query.finish()
        );
        let profile: ContactProfile = service.get(&path).await?;
        let columns = [
            &profile.normal_stress,
            &profile.tangential_stress,
            &profile.friction_bound,
        ];
        anyhow::ensure!(
            columns.iter().all(|column| column.len() == profile.s.len()),
            "the profile of {boundary:?} does not fit this version of signorini: its columns differ in length"
        );
        let view = ProfileView::of(boundary, &profile, Some(&summary));
        let points = |values: &[f64]| {
            let shown = view.points.clone();
            shown.map(|i| (profile.s[i], values[i])).collect()
        };
        let bound: Vec<f64> = profile
            .friction_bound
            .iter()
            .zip(&profile.tangential_stress)
            .map(|(bound, stress)| bound.copysign(*stress))
            .collect();
        let mut curves = vec![
            Curve {
                name: "σ_n",
                points: points(&profile.normal_stress),
            },
            Curve {
                name: "σ_t",
                points: points(&profile.tangential_stress),
            },
        ];
        if bound.iter().any(|bound| *bound != 0.0) {
            curves.push(Curve {
                name: "± bound of σ_t",
                points: points(&bound),
            });
        }
        figures.push(Chart {
            title: format!("Stresses along {boundary:?}{state}"),
            across: "s".into(),
            curves,
            scale: Scale::Within(view.stresses),
            note: view.peak,
        });
    }
    Ok(figures)
}

/// Makes a chart of the residuals by iteration, of load step `step` or of all steps. `wanted`: whether those of a job
/// without a solution will do.
async fn convergence(
    service: &Service,
    id: JobId,
    step: Option<u32>,
    wanted: bool,
) -> anyhow::Result<Chart> {
    let mut query = form_urlencoded::Serializer::new("format=json".to_owned());
    // of one step all rows are wanted, of all steps no more than can be seen
    if step.is_none() {
        query.append_pair("max_points", "2000");
    }
    query.extend_pairs(partial(wanted));
    let path = format!("/v1/jobs/{id}/history?{}", query.finish());
    let mut rows: Vec<TimedIteration> = service.get(&path).await?;
    if let Some(number) = step {
        rows.retain(|timed| timed.row.step == number);
    }
    let curve = |name, value: fn(&TimedIteration) -> f64| Curve {
        name,
        points: rows
            .iter()
            .map(|timed| (f64::from(timed.row.k), value(timed)))
            .collect(),
    };
    Ok(Chart {
        title: "Convergence".into(),
        across: "iteration".into(),
        curves: vec![
            curve("residual", |timed| timed.row.residual),
            curve("friction residual", |timed| timed.row.friction_residual),
            curve("tolerance", |timed| timed.row.tolerance),
        ],
        scale: Scale::Logarithmic,
        note: None,
    })
}

/// Opens a file with the desktop's program for files of its type.
fn open(path: &Path) -> anyhow::Result<()> {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let status = Command::new(program).arg(path).status();
    let status = status.with_context(|| {
        format!("{program}, which opens files on this machine, cannot be started")
    })?;
    anyhow::ensure!(
        status.success(),
        "{program} could not open {}",
        path.display()
    );
    Ok(())
}
