//! The command `signorini ls`.

use clap::{Arg, ArgAction, ArgGroup, ArgMatches, Args, Command, FromArgMatches};
use form_urlencoded::Serializer;
use serde_json::Value;
use store::{FILTERS, Field, Filter};

use super::{
    super::{
        exit::Exit,
        service::{Connection, Service},
    },
    listing::{Found, Shown},
    submit::label,
};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  signorini ls --status queued,running\n  \
    signorini ls --label study=radius -n 0 -f csv > study.csv\n  signorini rm $(signorini ls --status failed -q)")]
pub(crate) struct Arguments {
    /// List sweeps instead of jobs
    #[arg(long, conflicts_with_all = ["filters", "labels"])]
    sweeps: bool,

    #[command(flatten)]
    selected: Selected,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

/// The jobs or sweeps that a command is about.
#[derive(Debug, Args)]
pub(super) struct Selected {
    #[command(flatten)]
    filters: Filters,

    /// List only jobs with this label; can be repeated
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = label)]
    labels: Vec<(String, String)>,

    /// The largest number of jobs or sweeps to list, the newest first; 0: all
    #[arg(short = 'n', long, default_value_t = 20, value_name = "N")]
    limit: usize,
}

/// The filters that the service has, each with an option: the names and values for a query.
#[derive(Debug)]
struct Filters(Vec<(&'static str, String)>);

impl FromArgMatches for Filters {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let of = |field: &Field| {
            let given = matches.get_many::<String>(field.name).into_iter().flatten();
            let name = field.name;
            given
                .map(move |text| (name, text.clone()))
                .collect::<Vec<_>>()
        };
        Ok(Filters(FILTERS.iter().flat_map(of).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Filters::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for Filters {
    fn augment_args(command: Command) -> Command {
        FILTERS
            .iter()
            .fold(command, |command, field| {
                let checked = |text: &str| {
                    if (field.set)(&mut Filter::default(), text) {
                        Ok(text.to_owned())
                    } else {
                        Err(format!("expected {}", (field.expected)()))
                    }
                };
                let (value, help) = match (field.several, field.name.rsplit_once('_')) {
                    (true, _) => (
                        field.name,
                        format!("{}: {}", field.meaning, (field.expected)()),
                    ),
                    (_, Some((_, "after" | "before"))) => ("time", field.meaning.to_owned()),
                    (_, Some((_, last))) => (last, field.meaning.to_owned()),
                    (_, None) => (field.name, field.meaning.to_owned()),
                };
                let option = Arg::new(field.name)
                    .long(field.name.replace('_', "-"))
                    .help(help)
                    .value_name(value.to_uppercase())
                    .value_parser(checked)
                    .group("filters");
                command.arg(if field.several {
                    option.action(ArgAction::Append).value_delimiter(',')
                } else {
                    option
                })
            })
            .group(ArgGroup::new("filters").multiple(true))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Filters::augment_args(command)
    }
}

/// The largest page that the service gives.
const PAGE: usize = 1000;

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let list = if arguments.sweeps { "sweeps" } else { "jobs" };
    let (found, _) = arguments.selected.fetch(&service, list).await?;
    if found.is_empty() && arguments.shown.is_table() {
        eprintln!("there are no such {list}");
        return Ok(Exit::Ok);
    }
    arguments.shown.print(&Found::Many(found))?;
    Ok(Exit::Ok)
}

impl Selected {
    /// The documents of the selected jobs or sweeps, from as many pages as are needed, and whether the list goes on.
    pub(super) async fn fetch(
        &self,
        service: &Service,
        list: &str,
    ) -> anyhow::Result<(Vec<Value>, bool)> {
        let most = match self.limit {
            0 => usize::MAX,
            some => some,
        };
        let (mut found, mut page): (Vec<Value>, Option<String>) = (vec![], None);
        loop {
            let mut query = Serializer::new(String::new());
            query.extend_pairs(&self.filters.0);
            for (key, value) in &self.labels {
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
        Ok((found, page.is_some()))
    }
}
