//! The tokens that `signorini login` keeps for services, in a file that only its owner can read.

use std::{
    collections::BTreeMap,
    env, fs,
    io::{self, Read, Write},
    os::unix::fs::{DirBuilderExt, PermissionsExt},
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};
use reqwest::Url;

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
    let wanted = address(url);
    let has = match serde_json::from_str::<BTreeMap<String, String>>(&text) {
        Ok(tokens) => tokens.keys().any(|url| address(url) == wanted),
        Err(_) => text.contains(&wanted),
    };
    if !has {
        return Ok(None);
    }
    Ok(kept(&path)?.remove(&wanted))
}

/// The addresses for which tokens are kept, with commas; at most three of them.
pub(super) fn addresses() -> String {
    let all = file().and_then(|path| kept(&path)).unwrap_or_default();
    let some: Vec<String> = all.into_keys().take(3).collect();
    some.join(", ")
}

/// The address of a service in the form that its token is kept under, whichever way it was written: the host in lower case,
/// without the port that its scheme has anyway, and without a slash at the end.
pub(super) fn address(url: &str) -> String {
    let whole = Url::parse(url).map_or_else(|_| url.to_owned(), String::from);
    whole.trim_end_matches('/').to_owned()
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
    let tokens: BTreeMap<String, String> = serde_json::from_str(&text)
        .with_context(|| format!("{} is not what `signorini login` wrote", path.display()))?;
    // earlier versions kept addresses as they were written
    let tokens = tokens
        .into_iter()
        .map(|(url, token)| (address(&url), token));
    Ok(tokens.collect())
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn an_address_is_the_same_however_it_is_written() {
        for (written, kept) in [
            ("https://lab.example", "https://lab.example"),
            ("https://lab.example/", "https://lab.example"),
            ("HTTPS://Lab.Example:443/", "https://lab.example"),
            ("http://127.0.0.1:80", "http://127.0.0.1"),
            ("http://127.0.0.1:8080/", "http://127.0.0.1:8080"),
            (
                "https://lab.example:8443/Contact//",
                "https://lab.example:8443/Contact",
            ),
            ("not an address/", "not an address"),
        ] {
            assert_eq!(address(written), kept);
            assert_eq!(address(kept), kept);
        }
    }

    #[test]
    fn tokens_of_earlier_versions_are_found_by_other_spellings() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.json");
        let old = [("https://Lab.example:443".to_owned(), "sgn_1".to_owned())];
        write(&path, &old.into()).unwrap();
        let all = kept(&path).unwrap();
        assert_eq!(all.get(&address("https://lab.example/")).unwrap(), "sgn_1");
    }
}
