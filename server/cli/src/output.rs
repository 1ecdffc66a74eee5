//! The option `-o`: the content of a file is chosen by its name, and files are written atomically.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use anyhow::Context;
use base::run::Document;
use clap::Args;
use files::plot::{self, AxisLimits, Limits, Parts, Plot, Size, Style, Texts, Theme, image};
use service::formats::{self, Format};
use solver::{mesh::Mesh, problem::Problem, solution::Iteration};
use strum::VariantArray;

/// The help text of `-o`.
pub(super) fn help() -> String {
    let whole = [Format::Json, Format::Npz];
    let mut tables = Format::OF_TABLES.to_vec();
    tables.retain(|format| !whole.contains(format));
    format!(
        "Write the result to this file, in the format of its extension: .json everything; {} the profile of the \
         contact; .npz fields, profiles and history; .vtu the fields; .svg, .png and .pdf the profile as a figure. Put a part before \
         the extension to choose it: punch.summary.json, punch.history.csv, punch.fields.npz, punch.mesh.svg, punch.deformed.svg, \
         punch.convergence.svg; with several contacts name the boundary: punch.profile.top.csv. Can be repeated; - \
         writes JSON to standard output. Without it a summary is printed",
        Format::endings(&tables)
    )
}

/// Options for the look of figures.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Look {
    /// Colours of a figure: light or dark
    #[arg(long, default_value = "light")]
    theme: Theme,

    /// Use of a figure: a column of 88 mm, a page of 160 mm, or a slide of 16:9
    #[arg(long, default_value = "page", value_name = "column|page|slide")]
    size: Size,

    /// Texts around a figure: full has title, parameters, verdict and warnings, bare has none of them
    #[arg(long, default_value = "full", value_name = "full|bare")]
    style: Texts,

    /// Limits of a figure's horizontal axis: of arc length, of iterations, of x or r
    #[arg(long, value_name = "A,B", allow_hyphen_values = true)]
    xlim: Option<Limits>,

    /// Limits of a figure's vertical axis: of the normal stress, of residuals, of y or z
    #[arg(long, value_name = "A,B", allow_hyphen_values = true)]
    ylim: Option<Limits>,

    /// Limits of the vertical axis of the lower panels of the figures profile (tangential stress) and convergence (counts)
    #[arg(long, value_name = "A,B", allow_hyphen_values = true)]
    ylim_below: Option<Limits>,
}

impl Look {
    fn style(self) -> Style {
        Style {
            theme: self.theme,
            size: self.size,
            texts: self.style,
            limits: self.limits(),
            ..Style::default()
        }
    }

    fn limits(self) -> AxisLimits {
        AxisLimits {
            x: self.xlim,
            y: self.ylim,
            y_below: self.ylim_below,
        }
    }

    /// Checks the limits of axes for the figures among these outputs, before anything is solved; the error names all
    /// faults.
    pub(super) fn check(self, outputs: &[Output]) -> Result<(), String> {
        let mut faults: Vec<String> = Vec::new();
        for output in outputs {
            let Part::Plot(plot) = output.part else {
                continue;
            };
            let refused = plot.refused(&self.limits()).into_iter();
            faults.extend(refused.map(|(name, reason)| {
                format!("{}: --{}: {reason}", plot.as_str(), name.replace('_', "-"))
            }));
        }
        if faults.is_empty() {
            Ok(())
        } else {
            Err(faults.join("; "))
        }
    }

    /// The options as parameters of a request for a figure.
    pub(super) fn query(self) -> String {
        let mut query = form_urlencoded::Serializer::new(String::new());
        query.append_pair("theme", self.theme.into());
        query.append_pair("size", self.size.as_str());
        query.append_pair("style", self.style.as_str());
        let limits = [
            ("xlim", self.xlim),
            ("ylim", self.ylim),
            ("ylim_below", self.ylim_below),
        ];
        for (name, limits) in limits {
            query.extend_pairs(limits.map(|limits| (name, limits.to_string())));
        }
        query.finish()
    }
}

/// An output of a command: one file to be written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Output {
    /// The file's path; `None` is standard output.
    pub(super) path: Option<PathBuf>,
    pub(super) part: Part,
    pub(super) format: Format,
}

/// The part of a result that a file contains.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Part {
    Everything,
    /// Everything except columns with a row for each node, point or iteration.
    Summary,
    /// The profile of this contact boundary.
    Profile(String),
    History,
    Fields,
    Plot(Plot),
}

/// The names of the boundaries that have a profile.
#[derive(Debug, Default)]
pub(super) struct Profiles {
    /// Those of the contacts.
    pub(super) contacts: Vec<String>,
    /// Those of the bodies that face them.
    pub(super) facing: Vec<String>,
}

impl Profiles {
    pub(super) fn of(problem: &Problem) -> Profiles {
        let contacts = problem.contacts.iter();
        let facing = contacts
            .clone()
            .filter_map(|contact| contact.against.as_ref());
        Profiles {
            contacts: contacts.map(|contact| contact.boundary.clone()).collect(),
            facing: facing.map(|against| against.boundary.clone()).collect(),
        }
    }

    fn has(&self, name: &String) -> bool {
        self.contacts.contains(name) || self.facing.contains(name)
    }
}

impl Output {
    /// Reads the name of a file for a problem with these profiles; the error is the reason why the file
    /// cannot be written. This is called before the problem is solved, which may take hours.
    pub(super) fn parse(path: &Path, profiles: &Profiles) -> Result<Output, String> {
        if path.as_os_str() == "-" {
            return Ok(Output {
                path: None,
                part: Part::Everything,
                format: Format::Json,
            });
        }
        let error = |problem: String| format!("-o {}: {problem}", path.display());
        let name = path.file_name().and_then(|name| name.to_str());
        let (stem, ending) = name
            .and_then(|name| name.rsplit_once('.'))
            .unwrap_or_default();
        let ending = ending.to_ascii_lowercase();
        let format = Format::VARIANTS
            .iter()
            .find(|format| format.name() == ending);
        let format = *format.ok_or_else(|| {
            let endings = Format::endings(Format::VARIANTS);
            error(format!(
                "the file must have one of the extensions {endings}, or be - for JSON on standard output"
            ))
        })?;
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            return Err(error(format!("there is no folder {}", folder.display())));
        }
        Ok(Output {
            path: Some(path.to_path_buf()),
            part: part(format, stem, profiles).map_err(error)?,
            format,
        })
    }

    /// Writes the file. `problem` has the mesh that it names by a hash; `look` is for figures.
    pub(super) fn write(
        &self,
        problem: (&Problem, Option<&Mesh>),
        look: Look,
        document: &Document,
    ) -> anyhow::Result<()> {
        let Some(path) = &self.path else {
            return self.write_to(&mut std::io::stdout().lock(), problem, look, document);
        };
        replace(path, |out| self.write_to(out, problem, look, document))
            .with_context(|| format!("cannot write {}", path.display()))
    }

    fn write_to(
        &self,
        out: &mut dyn Write,
        (problem, stored): (&Problem, Option<&Mesh>),
        look: Look,
        document: &Document,
    ) -> anyhow::Result<()> {
        // many small pieces of a large file would take the system twice the time
        let mut out = BufWriter::with_capacity(1 << 16, out);
        let bytes = match &self.part {
            // without a second copy of the fields, which may be large
            Part::Everything if self.format == Format::Json => {
                serde_json::to_writer(&mut out, document)?;
                Ok(vec![])
            }
            Part::Everything => formats::everything_as_npz(document),
            Part::Summary => {
                serde_json::to_writer(&mut out, &document.summary)?;
                Ok(vec![])
            }
            Part::Profile(boundary) => match document.profiles.get(boundary) {
                Some(profile) => formats::profile(profile, self.format),
                None => Err(format!("the result has no profile of {boundary:?}")),
            },
            Part::History => formats::history(&formats::rows_of(&document.history), self.format),
            Part::Fields => formats::fields(&document.fields, self.format),
            Part::Plot(plot) => {
                let history: Vec<Iteration> = document
                    .history
                    .iter()
                    .map(|timed| timed.row.clone())
                    .collect();
                let parts = Parts {
                    history: &history,
                    summary: Some(&document.summary.solution),
                    partial: false,
                    step: None,
                    profiles: &document.profiles,
                    fields: &document.fields,
                    stored,
                };
                let image = self.format.image().unwrap_or_default();
                let drawn = plot::draw(*plot, look.style(), problem, &parts);
                drawn.and_then(|svg| image::write(svg, look.size, image))
            }
        };
        out.write_all(&bytes.map_err(anyhow::Error::msg)?)?;
        if matches!(self.format, Format::Json | Format::Svg) {
            writeln!(out)?;
        }
        Ok(out.flush()?)
    }
}

/// The part of a result that a file's name states before its extension, or the usual part for the extension.
fn part(format: Format, stem: &str, profiles: &Profiles) -> Result<Part, String> {
    let words: Vec<&str> = stem.split('.').collect();
    let last = words.last().copied().unwrap_or_default();
    // a boundary may have any name, also with dots or one of the words below: an existing name takes precedence
    let after = words.iter().enumerate();
    let after = after.filter(|(_, word)| **word == "profile");
    let mut named: Vec<String> = after
        .map(|(place, _)| words[place + 1..].join("."))
        .collect();
    named.retain(|name| !name.is_empty());
    let known = named.iter().find(|name| profiles.has(name));
    let asked = match known.or(named.last()) {
        Some(boundary) => Some(("profile", Some(boundary.clone()))),
        None => ["summary", "profile", "history", "fields"]
            .into_iter()
            .find(|word| *word == last)
            .map(|word| (word, None)),
    };
    let ending = format.name();
    if format.image().is_some() {
        return match (known, last.parse()) {
            (_, Ok(plot)) => Ok(Part::Plot(plot)),
            (Some(name), Err(_)) => Err(format!(
                "a figure shows the profiles of all contact boundaries, and not of {name:?} alone: name it NAME.profile.{ending}"
            )),
            (None, Err(_)) => Ok(Part::Plot(Plot::Profile)),
        };
    }
    match (asked, format) {
        (Some(("summary", _)), Format::Json) => Ok(Part::Summary),
        (Some(("summary", _)), _) => Err("the summary is written as .json only".into()),
        (Some(("fields", _)), f) if !Format::OF_FIELDS.contains(&f) => Err(format!(
            "fields are not written as .{ending}, but as one of {}",
            Format::endings(Format::OF_FIELDS)
        )),
        (None | Some(("fields", _)), Format::Vtu) => Ok(Part::Fields),
        (Some((word, _)), Format::Vtu) => Err(format!(
            "a .vtu file holds fields; the {word} is written as one of {}",
            Format::endings(Format::OF_TABLES)
        )),
        (None, Format::Json | Format::Npz) => Ok(Part::Everything),
        (Some(("fields", _)), _) => Ok(Part::Fields),
        (Some(("history", _)), _) => Ok(Part::History),
        (asked, _) => {
            let boundary = asked.and_then(|(_, boundary)| boundary);
            one_of(profiles, boundary, ending).map(Part::Profile)
        }
    }
}

fn one_of(profiles: &Profiles, asked: Option<String>, ending: &str) -> Result<String, String> {
    let all = [&profiles.contacts[..], &profiles.facing]
        .concat()
        .join(", ");
    match (asked, &profiles.contacts[..]) {
        (_, []) => Err("the problem has no contact, and so no profile; displacements and stresses are written as .vtu, .npz and .json".into()),
        (Some(name), _) if profiles.has(&name) => Ok(name),
        (Some(name), _) => Err(format!(
            "the problem has no contact boundary {name:?}; it has: {all}"
        )),
        (None, [only]) => Ok(only.clone()),
        (None, [first, ..]) => Err(format!(
            "the problem has several contact boundaries ({all}); name one, as in NAME.profile.{first}.{ending}"
        )),
    }
}

/// Writes a temporary file beside `path` and renames it, so that the file at `path` is never incomplete, and an older
/// file is kept until the new one is complete. A pipe or device is written directly.
pub(super) fn replace(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    // a link keeps pointing to the file, which gets the new content
    let target = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    if target.exists() && !target.is_file() {
        return write(&mut File::options().write(true).open(&target)?);
    }
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".signorini-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // with the permissions of any other new file (by the umask), not readable by the owner only
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder)?;
    write(&mut file)?;
    file.as_file().sync_all()?;
    file.persist(&target)?;
    Ok(())
}

/// Writes to standard output. It is no error if the reader has closed it, as `head` does after its last line.
pub(super) fn print(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn asked(name: &str, contacts: &[&str]) -> Result<(Part, Format), String> {
        let profiles = Profiles {
            contacts: contacts.iter().map(|name| (*name).to_owned()).collect(),
            facing: vec!["roller.bottom".to_owned()],
        };
        Output::parse(Path::new(name), &profiles).map(|output| (output.part, output.format))
    }

    #[test]
    fn the_name_of_a_file_determines_its_content() {
        let top = || Part::Profile("top".into());
        for (name, part, format) in [
            ("-", Part::Everything, Format::Json),
            ("punch.json", Part::Everything, Format::Json),
            ("punch.v2.NPZ", Part::Everything, Format::Npz),
            ("punch.csv", top(), Format::Csv),
            ("punch.jsonl", top(), Format::Jsonl),
            ("punch.profile.arrow", top(), Format::Arrow),
            ("punch.profile.top.csv", top(), Format::Csv),
            ("profile.top.json", top(), Format::Json),
            ("summary.json", Part::Summary, Format::Json),
            ("punch.summary.json", Part::Summary, Format::Json),
            ("history.csv", Part::History, Format::Csv),
            ("punch.history.npz", Part::History, Format::Npz),
            ("punch.fields.npz", Part::Fields, Format::Npz),
            ("punch.fields.json", Part::Fields, Format::Json),
            ("punch.vtu", Part::Fields, Format::Vtu),
            ("punch.svg", Part::Plot(Plot::Profile), Format::Svg),
            ("punch.profile.svg", Part::Plot(Plot::Profile), Format::Svg),
            ("punch.mesh.svg", Part::Plot(Plot::Mesh), Format::Svg),
            ("punch.mesh.png", Part::Plot(Plot::Mesh), Format::Png),
            ("punch.pdf", Part::Plot(Plot::Profile), Format::Pdf),
        ] {
            assert_eq!(asked(name, &["top"]).unwrap(), (part, format), "{name}");
        }
    }

    #[test]
    fn an_output_that_cannot_be_written_is_rejected_with_what_can() {
        for (name, contacts, part) in [
            ("punch", vec!["top"], ".json, .csv"),
            ("punch.xlsx", vec!["top"], ".vtu"),
            ("no-such-folder/punch.csv", vec!["top"], "no folder"),
            ("punch.fields.csv", vec!["top"], ".npz"),
            ("punch.summary.csv", vec!["top"], ".json"),
            (
                "punch.history.vtu",
                vec!["top"],
                "history is written as one of .json, .csv",
            ),
            ("punch.csv", vec![], "no contact"),
            ("punch.csv", vec!["left", "top"], "NAME.profile.left.csv"),
            (
                "punch.profile.bottom.csv",
                vec!["left", "top"],
                "it has: left, top",
            ),
        ] {
            let error = asked(name, &contacts).unwrap_err();
            assert!(error.contains(part), "{name}: {error}");
        }
    }

    #[test]
    fn both_sides_of_a_pair_of_bodies_have_a_profile() {
        let pair = ["block.top"];
        for (name, boundary) in [
            ("r.csv", "block.top"),
            ("r.profile.block.top.csv", "block.top"),
            ("r.profile.roller.bottom.csv", "roller.bottom"),
        ] {
            assert_eq!(
                asked(name, &pair).unwrap().0,
                Part::Profile(boundary.into()),
                "{name}"
            );
        }
        let error = asked("r.profile.other.csv", &pair).unwrap_err();
        assert!(
            error.contains("it has: block.top, roller.bottom"),
            "{error}"
        );
        let error = asked("r.profile.roller.bottom.svg", &pair).unwrap_err();
        assert!(error.contains("all contact boundaries"), "{error}");
    }

    #[test]
    fn a_boundary_may_have_any_name() {
        for boundary in ["history", "a.b", "profile", "x.profile.y"] {
            let name = format!("x.profile.{boundary}.csv");
            let found = asked(&name, &["left", boundary]).unwrap();
            assert_eq!(found.0, Part::Profile(boundary.into()));
        }
    }

    #[test]
    fn a_file_is_written_completely_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let link = folder.path().join("link.csv");
        replace(&path, |out| Ok(out.write_all(b"old")?)).unwrap();
        let failed = replace(&path, |out| {
            out.write_all(b"ne")?;
            anyhow::bail!("the disk is full")
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&path, &link).unwrap();
            replace(&link, |out| Ok(out.write_all(b"new")?)).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), b"new");
            assert!(link.is_symlink());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
