//! Unpacks the page of `/docs`, and collects the files of the page for people.

use std::{
    collections::BTreeSet,
    env,
    error::Error,
    fmt::Write as _,
    fs,
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use flate2::{Compression, write::GzEncoder};
use sha2::{Digest, Sha256};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=page");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    swagger_ui(&out)?;
    page(
        &PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("page"),
        &out,
    )
}

/// Extracts the files that `/docs` serves from the archive of Swagger UI: 1.7 of its 6 MB.
fn swagger_ui(out: &Path) -> Result<(), Box<dyn Error>> {
    let archive = io::Cursor::new(utoipa_swagger_ui_vendored::SWAGGER_UI_VENDORED);
    let mut archive = zip::ZipArchive::new(archive)?;
    let names = archive.file_names().map(|name| name.map(String::from));
    let names = names.collect::<Result<Vec<_>, _>>()?;
    for (end, to) in [
        ("/dist/swagger-ui.css", "swagger-ui.css"),
        ("/dist/swagger-ui-bundle.js", "swagger-ui-bundle.js"),
        ("/LICENSE", "swagger-ui-license.txt"),
    ] {
        let name = names.iter().find(|name| name.ends_with(end));
        let name = name.ok_or_else(|| format!("Swagger UI has no {end}"))?;
        io::copy(
            &mut archive.by_name(name)?,
            &mut fs::File::create(out.join(to))?,
        )?;
    }
    Ok(())
}

/// The name of the page in its folder; in its text `DIGEST` stands for the digest of all files, and `PRELOADS` for the links
/// to the modules that it begins with and those of a job.
const PAGE: &str = "index.html";

/// Writes the list of the page's files, each with its content as it is and compressed.
fn page(folder: &Path, out: &Path) -> Result<(), Box<dyn Error>> {
    let mut paths = vec![];
    collect(folder, "", &mut paths)?;
    paths.sort();
    let mut digest = Sha256::new();
    for path in &paths {
        digest.update(path);
        digest.update([0]);
        digest.update(fs::read(folder.join(path))?);
    }
    let digest: String = digest.finalize()[..8]
        .iter()
        .fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        });
    let mut list = String::from("static CONTENT: &[PageFile] = &[\n");
    fs::create_dir_all(out.join("page"))?;
    for (number, path) in paths.iter().enumerate() {
        let Some(media) = media(path) else { continue };
        let source = folder.join(path);
        let mut gzip = GzEncoder::new(vec![], Compression::best());
        gzip.write_all(&fs::read(&source)?)?;
        let compressed = out.join("page").join(number.to_string());
        fs::write(&compressed, gzip.finish()?)?;
        writeln!(
            list,
            "PageFile {{ path: {path:?}, media: {media:?}, content: include_bytes!({source:?}), gzip: include_bytes!({compressed:?}) }},"
        )?;
    }
    let mut modules = BTreeSet::new();
    imports(folder, "app.js", &mut modules)?;
    // a job is what an address is shared of, and what is opened next from the list
    imports(folder, "views/job.js", &mut modules)?;
    let preloads: String = modules.iter().fold(String::new(), |mut links, path| {
        let _ = writeln!(
            links,
            "<link rel=\"modulepreload\" href=\"web/{digest}/{path}\">"
        );
        links
    });
    let html = fs::read_to_string(folder.join(PAGE))?;
    let html = html
        .replace("PRELOADS\n", &preloads)
        .replace("DIGEST", &digest);
    writeln!(
        list,
        "];\n/// The digest of all files.\nconst DIGEST: &str = {digest:?};"
    )?;
    writeln!(list, "/// The page.\nconst PAGE: &str = {html:?};")?;
    let tag = format!("\"{digest}\"");
    writeln!(
        list,
        "/// The entity tag of the page.\nconst PAGE_TAG: &str = {tag:?};"
    )?;
    fs::write(out.join("page.rs"), list)?;
    Ok(())
}

/// Collects the paths of all files in a folder.
fn collect(folder: &Path, path: &str, found: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{path}{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            collect(&entry.path(), &format!("{name}/"), found)?;
        } else {
            found.push(name);
        }
    }
    Ok(())
}

/// The media type of a file that is served; `None` for one that is only for those who work on the page.
fn media(path: &str) -> Option<&'static str> {
    match path.rsplit_once('.')? {
        (name, _) if name.ends_with(".d") => None,
        (_, "js") => Some("text/javascript; charset=utf-8"),
        (_, "css") => Some("text/css; charset=utf-8"),
        _ => None,
    }
}

/// Collects the modules that a module imports at its start, and those that they import.
fn imports(folder: &Path, path: &str, found: &mut BTreeSet<String>) -> Result<(), Box<dyn Error>> {
    if !found.insert(path.to_owned()) {
        return Ok(());
    }
    let text = fs::read_to_string(folder.join(path))?;
    let place = Path::new(path).parent().unwrap_or(Path::new(""));
    for rest in text.split("from").skip(1) {
        let name = rest
            .trim_start()
            .strip_prefix('"')
            .and_then(|rest| rest.split('"').next());
        let Some(name) = name.filter(|name| name.starts_with('.')) else {
            continue;
        };
        let mut whole: Vec<String> = place
            .components()
            .map(|part| part.as_os_str().to_string_lossy().into_owned())
            .collect();
        for part in name.split('/') {
            match part {
                "." => {}
                ".." => drop(whole.pop()),
                part => whole.push(part.to_owned()),
            }
        }
        imports(folder, &whole.join("/"), found)?;
    }
    Ok(())
}
