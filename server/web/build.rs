//! Unpacks the page of `/docs`.

use std::{
    env,
    error::Error,
    fs, io,
    path::{Path, PathBuf},
};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    swagger_ui(&PathBuf::from(env::var("OUT_DIR")?))
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
