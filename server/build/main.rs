//! Generates the gRPC types, the conversions between them and our types, and the descriptor that reflection
//! serves. protox compiles the contract in Rust, so that protoc need not be installed. Also unpacks the page of
//! `/docs`.

mod conversions;
mod mirrors;

use std::{
    env,
    error::Error,
    fs, io,
    path::{Path, PathBuf},
};

use prost::Message;
use protox::prost_reflect::DescriptorPool;

fn main() -> Result<(), Box<dyn Error>> {
    for input in ["build", "../proto"] {
        println!("cargo:rerun-if-changed={input}");
    }
    let descriptors = protox::compile(["signorini/v1/signorini.proto"], ["../proto"])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("descriptors.bin"), descriptors.encode_to_vec())?;
    let pool = DescriptorPool::from_file_descriptor_set(descriptors.clone())?;
    fs::write(out.join("conversions.rs"), conversions::source(&pool)?)?;
    let mut types = prost_build::Config::new();
    // Ordered maps, so that equal responses have equal bytes; names, by which the codec finds a message's descriptor.
    types.btree_map(["."]).enable_type_names();
    tonic_prost_build::configure()
        .codec_path("crate::codec::Codec")
        .compile_fds_with_config(descriptors, types)?;
    swagger_ui(&out)
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
