//! The tokens that `signorini login` keeps for services, in a file that only its owner can read.

use std::{
    collections::BTreeMap,
    env, fs,
    io::{self, Read, Write},
    os::unix::fs::{DirBuilderExt, PermissionsExt},
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};

/// The token that is kept for the service at this address; `None` if there is none.
///
/// # Errors
///
/// The file cannot be read, or others can read it.
pub(super) fn token_for(url: &str) -> anyhow::Result<Option<String>> {
    // without a home, or with a file that cannot be read, there is none; a file that others can read is refused if it has it
    let Ok(path) = file() else { return Ok(None) };
    let Ok(text) = fs::read_to_string(&path) else {
        return Ok(None);
    };
    if !text.contains(&format!("{url:?}")) {
        return Ok(None);
    }
    Ok(kept(&path)?.remove(url))
}

/// The file with the tokens, by the addresses of their services.
pub(super) fn file() -> anyhow::Result<PathBuf> {
    let given = |name| env::var_os(name).filter(|value| !value.is_empty());
    let folder = match (given("XDG_CONFIG_HOME"), given("HOME")) {
        (Some(folder), _) => PathBuf::from(folder),
        (None, Some(home)) => Path::new(&home).join(".config"),
        (None, None) => bail!("there is no HOME to keep a token in; set SIGNORINI_TOKEN instead"),
    };
    Ok(folder.join("signorini").join("tokens.json"))
}

/// All tokens, by the addresses of their services.
pub(super) fn kept(path: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    let mut file = match fs::File::open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        file => file.with_context(|| path.display().to_string())?,
    };
    // of the file that is read, whatever takes its place meanwhile
    let mode = file.metadata()?.permissions().mode();
    let mut text = String::new();
    file.read_to_string(&mut text)
        .with_context(|| path.display().to_string())?;
    ensure!(
        mode & 0o077 == 0,
        "others can read {}, which has tokens: chmod 600 {0}, and rotate them (`signorini token rotate`)",
        path.display()
    );
    let tokens = serde_json::from_str(&text);
    tokens.with_context(|| format!("{} is not what `signorini login` wrote", path.display()))
}

/// Replaces the file.
pub(super) fn write(path: &Path, tokens: &BTreeMap<String, String>) -> anyhow::Result<()> {
    let folder = path.parent().context("the file of tokens has no folder")?;
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true).mode(0o700);
    builder
        .create(folder)
        .with_context(|| folder.display().to_string())?;
    // a temporary file is its owner's alone, and takes the place of the other in one step
    let mut new = tempfile::NamedTempFile::new_in(folder)?;
    writeln!(new, "{}", serde_json::to_string_pretty(tokens)?)?;
    new.persist(path)
        .with_context(|| path.display().to_string())?;
    Ok(())
}
