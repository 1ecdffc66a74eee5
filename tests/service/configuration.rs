//! Settings from flags, environment variables and a file: `serve` and `config show`.

use std::{
    path::Path,
    process::{Command, Output},
};

use suite::harness::Server;

use crate::SIGNORINI;

/// `config show` with these options, and no variables but these.
fn show(options: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut command = Command::new(SIGNORINI);
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("SIGNORINI_") {
            command.env_remove(name);
        }
    }
    command.args(["config", "show"]).args(options);
    command.envs(variables.iter().copied()).output().unwrap()
}

fn text(output: &Output) -> String {
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_flag_precedes_a_variable_which_precedes_the_file_which_precedes_the_default() {
    let folder = tempfile::tempdir().unwrap();
    let settings = "# of the lab\nworkers = 3\nmax_queued = 5\ngrace_s = 7\nallowed_hosts = [\"lab\", \"lab:1\"]\n\
        retain_days = 30\nretain_fields_days = 7.5\n";
    let file = write(folder.path(), "settings.toml", settings);
    let variables = [
        ("SIGNORINI_MAX_QUEUED", "6"),
        ("SIGNORINI_GRACE_S", "8"),
        ("SIGNORINI_MAX_CONNECTIONS", ""), // as if it were not set
    ];
    let options = ["--config", &file, "--grace-s", "9", "--origin"];
    let shown = text(&show(&options, &variables));
    for line in [
        format!("workers = 3  # {file}:2\n"),
        "max_queued = 6  # SIGNORINI_MAX_QUEUED\n".into(),
        "grace_s = 9  # --grace-s\n".into(),
        format!("allowed_hosts = [\"lab\", \"lab:1\"]  # {file}:5\n"),
        "max_connections = 8192  # default\n".into(),
        "isolation = \"thread\"  # default\n".into(),
        format!("retain_days = 30  # {file}:6\n"),
        format!("retain_fields_days = 7.5  # {file}:7\n"),
        "allow_unauthenticated = false  # default\n".into(),
        "# max_running_per_owner is not set: as many as there are workers\n".into(),
    ] {
        assert!(shown.contains(&line), "{line}is not in\n{shown}");
    }
}

#[test]
fn the_output_of_config_show_can_be_read_as_settings() {
    let folder = tempfile::tempdir().unwrap();
    let strange = folder.path().join("a \"quoted\"\nname\u{7f}");
    let options = [
        "--data",
        strange.to_str().unwrap(),
        "--workers=5",
        "--allow-unauthenticated",
        "--trusted-proxy=10.0.0.0/8,::1",
        "--log=info,hyper=warn",
        "--memory-budget-bytes=18446744073709551615",
    ];
    let first = text(&show(&options, &[]));
    let with_origin = text(&show(&[&options[..], &["--origin"]].concat(), &[]));
    for (name, shown) in [("first.toml", &first), ("origins.toml", &with_origin)] {
        let file = write(folder.path(), name, shown);
        // once by the flag and once by the variable
        assert_eq!(text(&show(&["--config", &file], &[])), first);
        assert_eq!(text(&show(&[], &[("SIGNORINI_CONFIG", &file)])), first);
    }
}

#[test]
fn other_commands_find_the_store_and_the_service_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (data, elsewhere) = (folder.path().join("store"), folder.path().join("other"));
    let settings = format!("data = {data:?}\nlisten = '127.0.0.1:1'\nworkers = 3\n");
    let file = write(folder.path(), "settings.toml", &settings);
    let run = |arguments: &[&str], variables: &[(&str, &str)]| {
        let mut command = Command::new(SIGNORINI);
        command.args(arguments).current_dir(folder.path());
        command.envs(variables.iter().copied()).output().unwrap()
    };
    let create = ["token", "create", "--name", "a", "--owner", "root"];
    let create = [&create[..], &["--scope", "admin"]].concat();
    // once by the variable and once by the flag
    text(&run(&create, &[("SIGNORINI_CONFIG", &file)]));
    let listed = text(&run(&["token", "list", "--config", &file], &[]));
    assert!(listed.contains("root"), "{listed}");
    for command in [&["doctor"][..], &["backup", "one"]] {
        text(&run(command, &[("SIGNORINI_CONFIG", &file)]));
    }
    // a flag and a variable come before the file
    let given = elsewhere.to_str().unwrap();
    text(&run(
        &["restore", "one", "--config", &file, "--data", given],
        &[],
    ));
    std::fs::remove_dir_all(&elsewhere).unwrap();
    let variables = [("SIGNORINI_CONFIG", &*file), ("SIGNORINI_DATA", given)];
    text(&run(&["restore", "one"], &variables));
    assert!(elsewhere.exists() && !folder.path().join("signorini-data").exists());
    let asked = run(&["health", "--config", &file], &[]);
    let told = String::from_utf8(asked.stderr).unwrap();
    assert!(told.contains("http://127.0.0.1:1/readyz"), "{told}");
    // a wrong file is told as `serve` tells it; a wrong variable only to a command that has it
    let wrong = write(folder.path(), "wrong.toml", "wokers = 3\n");
    let output = run(&["doctor", "--config", &wrong], &[]);
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.contains("did you mean workers?"), "{told}");
    text(&run(
        &["doctor", "--config", &file],
        &[("SIGNORINI_WORKERS", "257")],
    ));
}

#[test]
fn all_invalid_settings_are_reported_together_and_nothing_starts() {
    let folder = tempfile::tempdir().unwrap();
    let settings = "wokers = 3\nmax_queued = \"many\"\n\nisolation = \"proces\"\n";
    let file = write(folder.path(), "wrong.toml", settings);
    let variables = [("SIGNORINI_WORKERS", "257"), ("SIGNORINI_LOG", "loud")];
    for command in [&["config", "show"][..], &["serve"][..]] {
        let mut serve = Command::new(SIGNORINI);
        serve
            .args(command)
            .args(["--config", &file])
            .envs(variables);
        let output = serve.current_dir(folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let told = String::from_utf8(output.stderr).unwrap();
        let lines: Vec<&str> = told.lines().collect();
        let expected = [
            "signorini: SIGNORINI_WORKERS: found \"257\", expected an integer (257 is not in 0..=256)"
                .to_owned(),
            "signorini: SIGNORINI_LOG: found \"loud\", expected a level".to_owned(),
            format!("signorini: {file}:1: \"wokers\" is not a setting; did you mean workers?"),
            format!("signorini: {file}:2: max_queued: found \"many\", expected an integer"),
            format!("signorini: {file}:4: isolation: found \"proces\", expected thread or process"),
        ];
        assert_eq!(lines.len(), expected.len(), "{told}");
        for (line, expected) in lines.iter().zip(&expected) {
            assert!(line.starts_with(expected), "{line}\n{expected}");
        }
    }
    assert!(!folder.path().join("signorini-data").exists());
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let large = write(folder.path(), "large.toml", &"#\n".repeat(1 << 20));
    let absent = folder.path().join("absent.toml");
    for (file, told) in [
        (absent.to_str().unwrap(), "cannot be read"),
        (folder.path().to_str().unwrap(), "this is not a file"),
        ("/dev/zero", "this is not a file"),
        (&large, "more than 1 MiB"),
    ] {
        let output = show(&["--config", file], &[]);
        assert_eq!(output.status.code(), Some(2), "{file}");
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(error.contains(file) && error.contains(told), "{error}");
    }
}

/// Half of TLS would be plain text that nobody has asked for.
#[test]
fn a_certificate_and_its_key_are_set_both_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, settings: &str| write(folder.path(), name, settings);
    let cert = file("cert.toml", "tls_cert = \"cert.pem\"\n");
    let key = file("key.toml", "tls_key = \"key.pem\"\n");
    for (half, given, missing) in [
        (&cert, "--tls-cert", "--tls-key"),
        (&key, "--tls-key", "--tls-cert"),
    ] {
        for command in [&["config", "show"][..], &["serve", "--listen=127.0.0.1:0"]] {
            let mut half_of_tls = Command::new(SIGNORINI);
            half_of_tls.args(command).args(["--config", half]);
            let output = half_of_tls.current_dir(folder.path()).output().unwrap();
            assert_eq!(output.status.code(), Some(2), "{output:?}");
            let told = String::from_utf8(output.stderr).unwrap();
            assert!(
                told.contains(&format!("{given} is set, and {missing} is not")),
                "{told}"
            );
        }
    }
    // each from a source of its own
    let both = "tls_cert = \"cert.pem\"\ntls_key = \"key.pem\"\n";
    for shown in [
        show(&["--config", &cert, "--tls-key", "key.pem"], &[]),
        show(&["--config", &cert], &[("SIGNORINI_TLS_KEY", "key.pem")]),
        show(&["--config", &key, "--tls-cert", "cert.pem"], &[]),
        show(&["--config", &file("both.toml", both)], &[]),
    ] {
        assert!(text(&shown).contains(both), "{shown:?}");
    }
}

#[test]
fn a_variable_that_is_misspelt_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut serve = Command::new(SIGNORINI);
    // it cannot listen there, and ends soon
    serve.args([
        "serve",
        "--listen",
        "192.0.2.1:1",
        "--allow-unauthenticated",
        "--data",
    ]);
    serve.arg(folder.path().join("data"));
    serve.envs([("SIGNORINI_WOKERS", "3"), ("SIGNORINI_TOKEN", "sgn_")]);
    let output = serve.output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let log = String::from_utf8(output.stderr).unwrap();
    let told = "SIGNORINI_WOKERS is not a setting and is ignored; did you mean SIGNORINI_WORKERS?";
    assert!(
        log.contains(told) && !log.contains("SIGNORINI_TOKEN"),
        "{log}"
    );
}

#[tokio::test]
async fn serve_reads_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "serve.toml", "workers = 3\nmax_queued = 7\n");
    let server = Server::start(SIGNORINI, &["--config", &file, "--max-queued", "8"]).await;
    let info = server.json("/v1/info").await;
    assert_eq!(
        (&info["workers"], &info["limits"]["max_queued"]),
        (&3.into(), &8.into())
    );
}
