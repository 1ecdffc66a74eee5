//! The problems, decks and meshes that the documentation uses, and the files for administrators, compiled into the program:
//! a machine that has only the program can follow it too.

use std::{fs, io::Write, path::PathBuf};

use anyhow::Context;
use base::text::number_of;
use clap::Args;

use super::{exit::Exit, output};

/// The name and JSON of each problem of chapter 4 of the thesis.
pub(super) const ALL: [(&str, &str); 5] = service::verbs::examples::OF_THE_THESIS;

macro_rules! files {
    ($($path:literal)*) => {
        &[$(($path, include_bytes!(concat!("../../../", $path)))),*]
    };
}

/// The files that commands of the documentation read, by their paths in the folder of the sources.
const FILES: &[(&str, &[u8])] = files! {
    "examples/rectangular_punch.json"
    "examples/cylinder.json"
    "examples/annular_punch.json"
    "examples/cylinder_on_end.json"
    "examples/sheet.json"
    "examples/sweeps/rectangular_punch.json"
    "examples/sweeps/cylinder.json"
    "examples/sweeps/annular_punch.json"
    "examples/sweeps/cylinder_on_end.json"
    "examples/sweeps/sheet.json"
    "examples/sweeps/stick_width.json"
    "examples/sweeps/tangential_force.json"
    "examples/punch.R"
    "examples/tool_under_load.json"
    "examples/roller_on_block.json"
    "examples/press_fit.json"
    "docs/gallery/hertz.json"
    "docs/gallery/known_load.json"
    "docs/gallery/gmsh_part.json"
    "docs/gallery/measured.json"
    "docs/gallery/press_fit.json"
    "docs/gallery/fretting.json"
    "tests/data/abaqus/ring-cpe8.inp"
    "tests/data/abaqus/pair-fit-cpe8.inp"
    "tests/data/abaqus/roller-cpe8.inp"
    "tests/data/gmsh/hertz.geo"
    "tests/data/gmsh/hertz-tri6-msh41-binary.msh"
    "tests/data/gmsh/fillet.geo"
    "tests/data/gmsh/fillet-mixed-msh41-binary.msh"
    "contrib/Caddyfile"
    "contrib/compose.yaml"
    "contrib/nginx.conf"
    "contrib/grafana/signorini.json"
    "contrib/kubernetes/signorini.yaml"
    "contrib/prometheus/alerts.yml"
    "contrib/systemd/signorini.service"
};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The folder to write to; it is made if it does not exist, and files that it has stay as they are
    folder: PathBuf,
}

/// Writes the files, with the paths that the documentation names.
pub(super) fn run(Arguments { folder }: &Arguments) -> anyhow::Result<Exit> {
    let (mut written, mut kept) = (0, 0);
    for (path, bytes) in FILES {
        let path = folder.join(path);
        if let Some(parent) = path.parent() {
            let made = fs::create_dir_all(parent);
            made.with_context(|| format!("cannot make the folder {}", parent.display()))?;
        }
        let failed = || format!("cannot write {}", path.display());
        match fs::File::create_new(&path) {
            Ok(mut file) => {
                file.write_all(bytes).with_context(failed)?;
                written += 1;
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => kept += 1,
            Err(error) => return Err(error).with_context(failed),
        }
    }
    let there = match kept {
        0 => String::new(),
        kept => format!("; {} stay as they are", number_of(kept, "file")),
    };
    let (written, folder) = (number_of(written, "file"), folder.display());
    output::print(&format!(
        "{written} written to {folder}{there}. Commands of the documentation run there: cd {folder}; mkdir -p target\n"
    ))?;
    Ok(Exit::Ok)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{collections::BTreeSet, path::Path};

    use super::*;

    /// Every input that a page of the documentation names is there.
    #[test]
    fn the_files_are_those_that_the_documentation_names() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let pages = ["docs", "docs/how-to", "docs/concepts", "clients/python"];
        let mut named: BTreeSet<String> = BTreeSet::new();
        for folder in pages {
            for entry in fs::read_dir(root.join(folder)).unwrap() {
                let page = entry.unwrap().path();
                // it tells how times were measured, which takes the sources
                if page.extension() != Some("md".as_ref()) || page.ends_with("performance.md") {
                    continue;
                }
                let text = fs::read_to_string(&page).unwrap();
                let words =
                    text.split(|c: char| !(c.is_ascii_alphanumeric() || "/._-".contains(c)));
                let inputs = words.filter(|word| {
                    let ours = ["examples/", "docs/gallery/", "tests/data/"];
                    let kinds = [".json", ".inp", ".msh", ".geo", ".R"];
                    ours.iter().any(|start| word.starts_with(start))
                        && kinds.iter().any(|end| word.ends_with(end))
                });
                named.extend(inputs.map(str::to_owned));
            }
        }
        let there: BTreeSet<&str> = FILES.iter().map(|(path, _)| *path).collect();
        let missing: Vec<&String> = named
            .iter()
            .filter(|path| !there.contains(path.as_str()))
            .collect();
        assert!(named.len() > 15 && missing.is_empty(), "{missing:?}");
    }
}
