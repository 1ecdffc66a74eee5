//! The command `signorini watch`: prints a job's iterations while it runs, one on each line, and a curve of the
//! residual.

use std::{io::IsTerminal, ops::ControlFlow};

use anyhow::Context;
use base::{
    event::{Event, Payload},
    job::{Job, Status},
    sweep::MemberRow,
};
use clap::{Args, ValueEnum};
use serde_json::Value;

use super::{
    super::{
        exit::Exit,
        output,
        progress::{To, View},
        report,
        service::{Connection, Service, misunderstood},
    },
    follow,
    id::Id,
    listing::seconds,
};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini watch job_…\n  signorini watch -f jsonl job_… > events.jsonl\n\n\
    Ctrl-C ends the command; the job continues."
)]
pub(crate) struct Arguments {
    /// The job or the sweep
    id: Id,

    /// How to print: jsonl is the events as the service sends them
    #[arg(short, long, value_enum, default_value_t = Format::Table)]
    format: Format,

    #[command(flatten)]
    service: Connection,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Table,
    Jsonl,
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    follow(&service, arguments.id, arguments.format).await
}

/// Runs the command: prints the events of a job or sweep until the last one.
pub(super) async fn follow(service: &Service, id: Id, format: Format) -> anyhow::Result<Exit> {
    let mut watched = Watched {
        view: View::new(To::Output),
        format,
    };
    let mut ended = None;
    let work = follow::events(service, id, |event| {
        if format == Format::Jsonl {
            output::print(&format!("{event}\n"))?;
        }
        let done = event["type"] == "done";
        match (format, id) {
            (Format::Jsonl, _) if !done => {}
            (_, Id::Job(_)) => {
                let event = serde_json::from_value(event);
                let event: Event = event.with_context(|| misunderstood("the event"))?;
                if let Payload::Done { job } = watched.event(event)? {
                    ended = Some(follow::exit_of(&job));
                }
            }
            (_, Id::Sweep(_)) => ended = watched.member(&event)?.or(ended),
        }
        Ok(if done {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    });
    let heard = follow::detached(id, work).await;
    watched.view.end();
    heard?;
    match ended {
        Some(exit) => Ok(exit),
        // it had ended before, and its events are no longer kept
        None => {
            let document = service.get(&id.path()).await?;
            follow::exit_of_document(id, &document)
        }
    }
}

/// The state of a job or a sweep, as its events describe it.
struct Watched {
    view: View,
    format: Format,
}

impl Watched {
    fn event(&mut self, event: Event) -> anyhow::Result<Payload> {
        let view = &mut self.view;
        match &event.payload {
            Payload::Status { status, reason } => {
                if let (Status::Queued, Some(reason)) = (status, reason) {
                    view.line(&format!("queued again: {}", reason.replace('_', " ")))?;
                    view.anew();
                }
                view.state((*status).into());
            }
            Payload::Stage { stage } => view.phase(*stage)?,
            Payload::Mesh {
                number,
                elements,
                error,
            } => view.line(&report::mesh(*number, *elements, *error))?,
            Payload::Iteration(timed) => view.iteration(&timed.row)?,
            Payload::Warning(warning) => view.warning(warning)?,
            Payload::Done { job } => self.end(job)?,
        }
        Ok(event.payload)
    }

    fn end(&self, job: &Job) -> anyhow::Result<()> {
        let Job { id, run_s, .. } = job;
        let time = run_s.map_or(String::new(), |time| format!(" in {}", seconds(time)));
        let result = report::headline(job).map_or(String::new(), |result| format!("; {result}"));
        let text = match (job.status, &job.failure) {
            (Status::Succeeded, _) if job.cached_from.is_some() => {
                format!("succeeded: answered with an earlier result{result}")
            }
            (Status::Succeeded, _) => format!("succeeded{time}{result}"),
            (Status::Canceled, _) => format!("canceled{time}"),
            (_, Some(failure)) => format!("failed{time}: {}: {}", failure.title, failure.detail),
            (_, None) => format!("failed{time}"),
        };
        if self.format == Format::Table {
            self.view.line(&text)?;
            self.view.end();
            if std::io::stderr().is_terminal() {
                eprintln!("signorini result {id}");
            }
        }
        Ok(())
    }

    /// Prints an event of a sweep: a member that has ended, or the sweep itself.
    fn member(&mut self, event: &Value) -> anyhow::Result<Option<Exit>> {
        if event["type"] == "done" {
            let sweep = &event["sweep"];
            let count = |key: &str| sweep["members"][key].as_u64().unwrap_or_default();
            let (total, succeeded) = (count("total"), count("succeeded"));
            if self.format == Format::Table {
                self.view.line(&format!(
                    "{}: {succeeded} of {total} members succeeded",
                    sweep["status"].as_str().unwrap_or_default()
                ))?;
            }
            return Ok(Some(follow::exit_of_sweep(sweep)));
        }
        let member = event.get("member").unwrap_or(event);
        let Ok(row) = serde_json::from_value::<MemberRow>(member.clone()) else {
            return Ok(None);
        };
        let values = row
            .parameters
            .iter()
            .map(|(path, value)| format!("{path} = {}", value.json()));
        let values: Vec<String> = values.collect();
        let force = row.normal_force.map_or(String::new(), |force| {
            format!("  normal force {}", report::number(force))
        });
        let status = <&str>::from(row.status);
        self.view.line(&format!(
            "{:>6}  {status:<9}  {}{force}",
            row.number,
            values.join(", ")
        ))?;
        self.view.state(&format!("member {}", row.number));
        Ok(None)
    }
}
