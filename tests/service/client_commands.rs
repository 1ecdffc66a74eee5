//! The client commands of the binary, against a service: what they print, and how they end.

use std::{
    path::{Path, PathBuf},
    process::{Output, Stdio},
    time::{Duration, Instant},
};

use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, block, large, soon},
};
use tokio::process::{Child, Command};

use crate::{SIGNORINI, server};

/// A command for the service at this address.
fn command(url: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(SIGNORINI);
    command.args(arguments).env("SIGNORINI_URL", url);
    command.env_remove("SIGNORINI_TOKEN").stdin(Stdio::null());
    command.kill_on_drop(true);
    command
}

/// What a command with this folder of settings and this standard input prints, and its exit code.
async fn with_input(
    url: &str,
    folder: &Path,
    arguments: &[&str],
    input: &str,
) -> (Option<i32>, String) {
    let file = write(folder, "input", input);
    let mut command = command(url, arguments);
    command.env("XDG_CONFIG_HOME", folder);
    command.stdin(std::fs::File::open(file).unwrap());
    let output = soon(&arguments.join(" "), command.output()).await.unwrap();
    let told = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(told).unwrap())
}

/// Operations: GetCaller
#[tokio::test]
async fn a_token_is_kept_in_a_file_that_only_its_owner_can_read() {
    use std::os::unix::fs::PermissionsExt;
    let server = server().await;
    let body = json!({"name": "test", "owner": "root", "scopes": ["admin"]});
    let (_, admin) = crate::auth::create(&server, None, body).await;
    let (url, home) = (&server.url, tempfile::tempdir().unwrap());
    let folder = home.path();
    let file = folder.join("signorini/tokens.json");
    let (code, told) = with_input(url, folder, &["ls"], "").await;
    assert_eq!(code, Some(7), "{told}");
    let (code, told) = with_input(url, folder, &["login"], "sgn_nobodys\n").await;
    assert!(code == Some(7) && !file.exists(), "{told}");
    let (code, told) = with_input(url, folder, &["login"], "\n").await;
    assert!(
        code == Some(1) && told.contains("there is no token"),
        "{told}"
    );

    let (code, told) = with_input(url, folder, &["login"], &format!("{admin}\n")).await;
    assert!(
        code == Some(0) && told.contains("root") && !told.contains(&admin),
        "{told}"
    );
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!((mode(&file), mode(file.parent().unwrap())), (0o600, 0o700));
    let (code, told) = with_input(url, folder, &["ls"], "").await;
    assert_eq!(code, Some(0), "{told}");
    // of this service only
    let other = crate::server().await;
    let (code, told) = with_input(&other.url, folder, &["logout"], "").await;
    assert_eq!(code, Some(6), "{told}");

    let open = std::fs::Permissions::from_mode(0o644);
    std::fs::set_permissions(&file, open).unwrap();
    let (code, told) = with_input(url, folder, &["ls"], "").await;
    assert!(code == Some(1) && told.contains("chmod 600"), "{told}");
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o600)).unwrap();
    let (code, told) = with_input(url, folder, &["logout"], "").await;
    assert_eq!(code, Some(0), "{told}");
    let (code, told) = with_input(url, folder, &["ls"], "").await;
    assert_eq!(code, Some(7), "{told}");
}

async fn run(url: &str, arguments: &[&str]) -> Output {
    let output = command(url, arguments).output();
    soon(&arguments.join(" "), output).await.unwrap()
}

/// What a command prints that ends with this code.
async fn ends(url: &str, arguments: &[&str], code: i32) -> (String, String) {
    let output = run(url, arguments).await;
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let (out, err) = (text(output.stdout), text(output.stderr));
    assert_eq!(
        output.status.code(),
        Some(code),
        "{arguments:?}\n{out}\n{err}"
    );
    (out, err)
}

fn spawn(url: &str, arguments: &[&str]) -> Child {
    let mut command = command(url, arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn problem(folder: &Path, name: &str) -> String {
    write(
        folder,
        &format!("{name}.json"),
        &example_json(name).to_string(),
    )
}

fn ids(text: &str) -> Vec<String> {
    text.lines().map(str::to_owned).collect()
}

fn examples(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples")
        .join(file)
}

#[tokio::test]
async fn a_problem_is_submitted_waited_for_listed_and_its_result_printed() {
    let (server, folder) = (
        Server::start(SIGNORINI, &[]).await,
        tempfile::tempdir().unwrap(),
    );
    let url = &*server.url;
    let file = problem(folder.path(), "sheet");
    let submit = [
        "submit", &file, "--name", "first", "--label", "study=a", "--cache", "off", "-q",
    ];
    let id = ends(url, &submit, 0).await.0.trim().to_owned();
    assert!(id.starts_with("job_"), "{id}");
    let (shown, _) = ends(url, &["wait", &id], 0).await;
    assert!(
        shown.contains("succeeded") && shown.contains("first"),
        "{shown}"
    );

    let (card, _) = ends(url, &["get", &id], 0).await;
    assert!(
        card.contains("study=a") && card.contains("result              final"),
        "{card}"
    );
    let (text, _) = ends(url, &["get", &id, "-f", "json"], 0).await;
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document, server.job(&id).await);

    for (filter, found) in [("study=a", true), ("study=b", false)] {
        let (listed, _) = ends(url, &["ls", "--label", filter, "-q"], 0).await;
        assert_eq!(ids(&listed) == [id.clone()], found, "{filter}: {listed}");
    }
    let (rows, _) = ends(url, &["ls", "-f", "csv"], 0).await;
    assert!(rows.starts_with("id,status,reason,name,owner,"), "{rows}");
    assert_eq!(rows.lines().count(), 2);
    let (lines, _) = ends(url, &["ls", "-f", "jsonl"], 0).await;
    assert_eq!(
        serde_json::from_str::<Value>(lines.trim()).unwrap()["id"],
        *id
    );

    let (report, _) = ends(url, &["result", &id], 0).await;
    assert!(
        report.contains("normal force") && report.contains("accuracy"),
        "{report}"
    );
    // the same bytes as those of the service
    for (arguments, path) in [
        (&["-f", "csv"][..], "profiles/{}?format=csv"),
        (
            &["--profile", "--points", "21", "-f", "jsonl"],
            "profiles/{}?format=jsonl&points=21",
        ),
        (&["--history", "-f", "csv"], "history?format=csv"),
    ] {
        let summary = server.json(&format!("/v1/jobs/{id}/result")).await;
        let contacts = summary["summary"]["contacts"].as_object().unwrap();
        let boundary = contacts.keys().next().unwrap();
        let path = format!("/v1/jobs/{id}/{}", path.replace("{}", boundary));
        let expected = server
            .get(&path)
            .send()
            .await
            .unwrap()
            .text()
            .await
            .unwrap();
        let (printed, _) = ends(url, &[&["result", &id], arguments].concat(), 0).await;
        assert_eq!(printed, expected, "{arguments:?}");
    }
    let (table, _) = ends(url, &["result", &id, "--profile", "--points", "5"], 0).await;
    assert_eq!(table.lines().count(), 6, "{table}");

    let name = |file: &str| folder.path().join(file).to_str().unwrap().to_owned();
    let files = [
        "a.csv",
        "a.history.csv",
        "a.summary.json",
        "a.vtu",
        "a.fields.npz",
        "a.svg",
        "a.convergence.svg",
        "a.mesh.png",
        "a.pdf",
    ];
    let mut save = vec!["result".to_owned(), id.clone()];
    save.extend(files.iter().flat_map(|file| ["-o".to_owned(), name(file)]));
    let save: Vec<&str> = save.iter().map(String::as_str).collect();
    ends(url, &save, 0).await;
    let read = |file: &str| std::fs::read(name(file)).unwrap();
    assert!(files.iter().all(|file| !read(file).is_empty()));
    let fields = server
        .get(&format!("/v1/jobs/{id}/fields?format=vtu"))
        .send()
        .await
        .unwrap();
    assert!(read("a.vtu") == fields.bytes().await.unwrap());
    ends(url, &["result", &id, "-o", &name("a.xlsx")], 2).await;
    // nothing is written if one of the names is wrong
    let (first, whole) = (name("b.csv"), name("b.json"));
    let (_, said) = ends(url, &["result", &id, "-o", &first, "-o", &whole], 2).await;
    assert!(said.contains("NAME.summary.json"), "{said}");
    assert!(!Path::new(&first).exists());

    let (drawn, _) = ends(url, &["plot", &id], 0).await;
    for part in [
        "Stresses along",
        "Convergence",
        "σ_n",
        "friction residual",
        "iteration",
    ] {
        assert!(drawn.contains(part), "{part} is not in\n{drawn}");
    }
    assert!(
        drawn
            .chars()
            .any(|c| ('\u{2801}'..='\u{28ff}').contains(&c))
            && !drawn.contains('\x1b')
    );
    let figure = name("mesh.svg");
    ends(url, &["plot", &id, "mesh", "-o", &figure], 0).await;
    assert!(
        std::fs::read_to_string(&figure)
            .unwrap()
            .starts_with("<svg")
    );
    ends(url, &["plot", &id, "mesh"], 2).await;
    let figure = name("mesh.pdf");
    let column = ["--size", "column", "--theme", "dark"];
    let pdf = ["plot", &id, "mesh", "-o", &figure];
    ends(url, &[&pdf[..], &column].concat(), 0).await;
    assert!(std::fs::read(&figure).unwrap().starts_with(b"%PDF-"));
    let (_, said) = ends(url, &["plot", &id, "-o", &name("x.gif")], 2).await;
    assert!(said.contains(".svg, .png, .pdf"), "{said}");

    let again = ends(url, &["retry", &id, "-q"], 0)
        .await
        .0
        .trim()
        .to_owned();
    ends(url, &["wait", &again, "-q"], 0).await;
    assert_eq!(server.job(&again).await["parent"], *id);
    ends(url, &["rm", &id, "--fields"], 0).await;
    let status = server
        .get(&format!("/v1/jobs/{id}/fields"))
        .send()
        .await
        .unwrap()
        .status();
    assert_eq!(status, 404);
    assert_eq!(
        ends(url, &["rm", &id, &again], 0).await.0,
        format!("{id}\n{again}\n")
    );
    ends(url, &["get", &id], 6).await;
}

#[tokio::test]
async fn the_state_of_a_job_without_a_solution_is_printed_and_drawn_if_it_is_asked_for() {
    let (server, folder) = (server().await, tempfile::tempdir().unwrap());
    let url = &*server.url;
    let mut cut = example_json("rectangular_punch");
    cut["solver"] = json!({ "max_iterations": 3 });
    let cut = write(folder.path(), "cut.json", &cut.to_string());
    let (id, _) = ends(url, &["submit", &cut, "-q"], 0).await;
    let id = id.trim();
    ends(url, &["wait", id, "-q"], 9).await;
    // the result document says itself that it is none
    let (_, told) = ends(url, &["result", id], 0).await;
    assert!(told.contains("the result is partial"), "{told}");
    let (rows, _) = ends(url, &["ls", "-f", "csv"], 0).await;
    assert!(
        rows.contains("not_converged") && !rows.contains("normal_force"),
        "{rows}"
    );
    let name = |file: &str| folder.path().join(file).to_str().unwrap().to_owned();
    let (csv, vtu, svg) = (name("a.csv"), name("a.vtu"), name("a.convergence.svg"));
    let figure = name("b.svg");
    let cases: [&[&str]; 8] = [
        &["result", id, "--profile"],
        &["result", id, "-f", "csv"],
        &["result", id, "--history", "-f", "jsonl"],
        &["result", id, "-o", &csv],
        &["result", id, "-o", &vtu, "-o", &svg],
        &["plot", id],
        &["plot", id, "convergence"],
        &["plot", id, "deformed", "-o", &figure],
    ];
    for case in cases {
        let (_, told) = ends(url, case, 1).await;
        for part in ["did not converge", "--partial", "explain partial-result"] {
            assert!(told.contains(part), "{case:?}: {told}");
        }
        ends(url, &[case, &["--partial"]].concat(), 0).await;
    }
    for file in [&csv, &vtu, &svg, &figure] {
        assert!(std::fs::metadata(file).unwrap().len() > 100, "{file}");
    }
    assert!(
        std::fs::read_to_string(&figure)
            .unwrap()
            .contains("PARTIAL")
    );
    let (drawn, _) = ends(url, &["plot", id, "profile", "--partial"], 0).await;
    assert!(drawn.contains("partial: no solution"), "{drawn}");
    ends(url, &["plot", id, "mesh", "-o", &figure], 0).await;
    let explained = ends(url, &["explain", "partial-result"], 0).await.0;
    assert!(
        explained.contains("409") && explained.contains("--partial"),
        "{explained}"
    );
}

#[tokio::test]
async fn jobs_are_printed_and_saved_as_one_table() {
    let (server, folder) = (server().await, tempfile::tempdir().unwrap());
    let url = &*server.url;
    let problem = problem(folder.path(), "rectangular_punch");
    for number in ["1", "2", "3"] {
        let label = format!("n={number}");
        ends(
            url,
            &[
                "submit", &problem, "--label", &label, "--name", "=1+1", "--wait",
            ],
            0,
        )
        .await;
    }
    let columns = [
        "--columns",
        "label.n,name,status,normal_force,normal_force_error",
    ];
    let (csv, told) = ends(url, &[&["table"], &columns[..]].concat(), 0).await;
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(
        lines[0],
        "label.n,name,status,normal_force,normal_force_error"
    );
    assert!(lines.len() == 4 && !told.contains("newest"), "{csv}{told}");
    assert!(lines[1].starts_with("3,'=1+1,succeeded,"), "{csv}");
    let force: f64 = lines[1].split(',').nth(3).unwrap().parse().unwrap();
    let job = &server.json("/v1/jobs?label.n=3").await["jobs"][0];
    assert_eq!(job["quantities"][0]["value"], force);
    let (csv, told) = ends(url, &["table", "-n", "2"], 0).await;
    assert_eq!(csv.lines().count(), 3);
    assert!(told.contains("2 newest jobs only"), "{told}");
    let name = |file: &str| folder.path().join(file).to_str().unwrap().to_owned();
    for (file, start) in [
        ("a.arrow", &b"ARROW1"[..]),
        ("a.npz", b"PK"),
        ("a.json", b"[{\"id\":"),
        ("a.csv", b"id,name"),
    ] {
        ends(url, &["table", "--label", "n=1", "-o", &name(file)], 0).await;
        assert!(
            std::fs::read(name(file)).unwrap().starts_with(start),
            "{file}"
        );
    }
    let (_, told) = ends(url, &["table", "--columns", "id,colour"], 2).await;
    assert!(
        told.contains("label.KEY") && told.contains("peak_tangential_stress"),
        "{told}"
    );
    let (_, told) = ends(url, &["table", "-o", &name("a.xlsx")], 2).await;
    assert!(told.contains(".arrow"), "{told}");
}

#[tokio::test]
async fn every_end_has_its_exit_code() {
    let (server, folder) = (
        Server::start(SIGNORINI, &["--workers", "1", "--max-queued", "2"]).await,
        tempfile::tempdir().unwrap(),
    );
    let url = &*server.url;
    let save = |name: &str, problem: &Value| write(folder.path(), name, &problem.to_string());
    // 1: a body that nothing holds; 9: an iteration that is cut short
    let mut loose = block(6, 6);
    loose["supports"] = json!([{ "boundary": "left", "ux": 0 }]);
    loose["loads"] = json!([{ "boundary": "bottom", "traction": [0, -1] }]);
    loose["contacts"][0]["indentation"] = json!(-1);
    let mut cut = block(6, 6);
    cut["solver"] = json!({ "max_iterations": 1 });
    let (loose, cut) = (save("loose.json", &loose), save("cut.json", &cut));
    let submit = async |file: &str| {
        ends(url, &["submit", file, "-q", "--cache", "off"], 0)
            .await
            .0
            .trim()
            .to_owned()
    };
    let (failed, cut) = (submit(&loose).await, submit(&cut).await);
    ends(url, &["wait", &cut], 9).await;
    ends(url, &["watch", &cut], 9).await;
    ends(url, &["wait", &failed], 1).await;
    ends(url, &["wait", &failed, &cut], 9).await;

    // 4: it has not ended; 3: it was canceled
    let long = submit(&save("large.json", &large())).await;
    let began = Instant::now();
    let (_, shown) = ends(url, &["wait", &long, "--timeout", "0.3"], 4).await;
    assert_eq!(shown, "");
    assert!(began.elapsed() >= Duration::from_millis(300));
    ends(url, &["cancel", &long], 0).await;
    ends(url, &["wait", &long], 3).await;
    ends(url, &["cancel", &long], 0).await;

    let change = [
        "edit", &cut, "--pin", "--name", "kept", "--label", "a=1", "--label", "b=2", "-f", "json",
    ];
    let (edited, _) = ends(url, &change, 0).await;
    let edited: Value = serde_json::from_str(&edited).unwrap();
    let job = edited.get(0).unwrap_or(&edited);
    assert_eq!(job["pinned"], true, "{edited}");
    assert_eq!(
        (&job["name"], &job["labels"]),
        (&json!("kept"), &json!({"a": "1", "b": "2"}))
    );
    ends(url, &["edit", &cut, "--unpin"], 0).await;
    ends(url, &["edit", &cut, "--pin", "--unpin"], 2).await;

    // 2: not a problem, with all its lines; no id; an option that there is not
    let mut wrong = block(6, 6);
    wrong["materials"][0]["poissons_ratio"] = json!(0.7);
    wrong["contacts"][0]["friction"]["coeficient"] = json!(1);
    let text = serde_json::to_string_pretty(&wrong).unwrap();
    let wrong = write(folder.path(), "wrong.json", &text);
    let line = 1 + text
        .lines()
        .position(|line| line.contains("coeficient"))
        .unwrap();
    for verb in ["submit", "validate"] {
        let (_, told) = ends(url, &[verb, &wrong], 2).await;
        assert!(told.contains(&format!("{wrong}:{line}: ")), "{told}");
        assert!(told.contains("coeficient"), "{told}");
    }
    let (_, told) = ends(url, &["submit", &write(folder.path(), "no.json", "{")], 2).await;
    assert!(told.contains("no.json"), "{told}");
    ends(url, &["get", "job_1"], 2).await;
    ends(url, &["submit", &wrong, &wrong, "--watch"], 2).await;
    ends(url, &["ls", "--status", "done"], 2).await;

    // 6: there is none; 5: nobody is there; 8: the queue is full
    let none = "job_01890a5d-ac96-774b-bcce-b302099a8057";
    for verb in [
        "get", "watch", "wait", "result", "plot", "cancel", "retry", "rm",
    ] {
        ends(url, &[verb, none], 6).await;
    }
    ends(url, &["edit", none, "--pin"], 6).await;
    ends(url, &["edit", none], 2).await;
    let (_, told) = ends("http://127.0.0.1:1", &["ls"], 5).await;
    assert!(told.contains("cannot reach http://127.0.0.1:1"), "{told}");
    server.post("/v1/queue/pause").send().await.unwrap();
    let sheet = problem(folder.path(), "sheet");
    let full: Vec<&str> = ["submit", "--cache", "off", "-q"]
        .into_iter()
        .chain([&*sheet; 4])
        .collect();
    let (accepted, told) = ends(url, &full, 8).await;
    assert_eq!(
        ids(&accepted).len(),
        2,
        "those that were accepted are printed"
    );
    let named = format!("stopped at {sheet}; not submitted: {sheet}\n");
    assert!(
        told.contains("queue-full") && told.contains(&named),
        "{told}"
    );
}

#[tokio::test]
async fn a_load_step_and_a_stress_are_drawn() {
    let server = server().await;
    let folder = tempfile::tempdir().unwrap();
    let mut problem = example_json("rectangular_punch");
    problem["steps"] = json!([{ "name": "half", "indentation": 0.5 }, { "name": "whole" }]);
    problem["mesh"]["refine"] = json!(0);
    let id = server.submit(&problem).await;
    server.until_done(&id).await;
    let url = &server.url;
    let mut drawn = vec![];
    for step in ["half", "1"] {
        drawn.push(ends(url, &["plot", &id, "--step", step], 0).await.0);
    }
    assert!(drawn[0].contains("Convergence") && drawn[0] != drawn[1]);
    assert_eq!(
        drawn[1],
        ends(url, &["plot", &id, "--step", "whole"], 0).await.0
    );
    let (_, said) = ends(url, &["plot", &id, "--step", "third"], 6).await;
    assert!(said.contains("half, whole"), "{said}");
    let file = folder.path().join("figure.svg");
    let file = file.to_str().unwrap();
    let read = || std::fs::read_to_string(file).unwrap();
    ends(url, &["plot", &id, "-o", file, "--step", "half"], 0).await;
    assert!(read().contains("load step half"));
    let deformed = ["plot", &id, "deformed", "-o", file];
    ends(url, &deformed, 0).await;
    let mises = read();
    ends(url, &[&deformed[..], &["--stress", "xy"]].concat(), 0).await;
    assert_ne!(read(), mises);
    let (_, said) = ends(url, &["plot", &id, "--stress", "xy"], 2).await;
    assert!(said.contains("is for the figure deformed"), "{said}");
    ends(url, &["plot", &id, "deformed", "--stress", "zy"], 2).await;
}

#[tokio::test]
async fn a_token_is_sent_and_one_that_is_refused_has_its_exit_code() {
    let server = Server::start(SIGNORINI, &[]).await;
    let created = ends(
        &server.url,
        &[
            "token",
            "create",
            "--url",
            &server.url,
            "--name",
            "a",
            "--owner",
            "root",
            "--scope",
            "admin",
        ],
        0,
    )
    .await;
    let secret = created.0.trim();
    ends(&server.url, &["ls"], 7).await;
    let mut list = command(&server.url, &["ls", "-f", "json"]);
    let output = soon("ls", list.env("SIGNORINI_TOKEN", secret).output())
        .await
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    assert_eq!(output.stdout, b"[]\n");
}

#[tokio::test]
async fn valid_problems_are_reported_with_their_cost() {
    let server = server().await;
    let file = examples("rectangular_punch.json");
    let (shown, _) = ends(&server.url, &["validate", file.to_str().unwrap()], 0).await;
    assert!(
        shown.contains("valid               yes") && shown.contains("memory"),
        "{shown}"
    );
    let (text, _) = ends(
        &server.url,
        &["validate", file.to_str().unwrap(), "--json"],
        0,
    )
    .await;
    assert_eq!(serde_json::from_str::<Value>(&text).unwrap()["valid"], true);
}

/// The events that `watch` prints, across a crash of the service: each once.
#[tokio::test]
async fn a_watch_and_a_wait_go_on_when_the_service_comes_back() {
    let mut server = Server::start(SIGNORINI, &["--workers", "1"]).await;
    let folder = tempfile::tempdir().unwrap();
    let port = server.url.rsplit(':').next().unwrap().to_owned();
    let file = write(folder.path(), "large.json", &block(240, 200).to_string());
    let submit = ["submit", &file, "-q", "--cache", "off"];
    let id = ends(&server.url, &submit, 0).await.0.trim().to_owned();
    server.until_running(&id).await;
    let watch = spawn(&server.url, &["watch", "-f", "jsonl", &id]);
    // less than one request waits: a service that is gone must not end it early
    let wait = ["wait", &id, "-f", "json", "--timeout", "29"];
    let wait = spawn(&server.url, &wait);
    tokio::time::sleep(Duration::from_millis(300)).await;
    server.kill().await;
    tokio::time::sleep(Duration::from_millis(500)).await;
    server.restart_at(&format!("127.0.0.1:{port}")).await;
    let watched = soon("watch", watch.wait_with_output()).await.unwrap();
    let waited = soon("wait", wait.wait_with_output()).await.unwrap();
    assert!(
        watched.status.success() && waited.status.success(),
        "{watched:?}\n{waited:?}"
    );
    let events = String::from_utf8(watched.stdout).unwrap();
    let numbers: Vec<i64> = events
        .lines()
        .map(|line| {
            serde_json::from_str::<Value>(line).unwrap()["seq"]
                .as_i64()
                .unwrap()
        })
        .collect();
    assert_eq!(numbers, (1..=numbers.len() as i64).collect::<Vec<_>>());
    let last: Value = serde_json::from_str(events.lines().last().unwrap()).unwrap();
    assert_eq!(last["type"], "done");
    let job: Value = serde_json::from_slice(&waited.stdout).unwrap();
    assert_eq!(
        (&job["status"], &job["attempt"]),
        (&json!("succeeded"), &json!(2))
    );
}

#[tokio::test]
async fn a_sweep_is_submitted_watched_and_its_table_printed() {
    let (server, folder) = (
        Server::start(SIGNORINI, &[]).await,
        tempfile::tempdir().unwrap(),
    );
    let url = &*server.url;
    problem(folder.path(), "sheet");
    let sweep = json!({
        "base": "sheet.json",
        "axes": [{ "path": "/contacts/0/friction/coefficient", "values": [0.0, 0.2, 0.4] }],
    });
    let file = write(folder.path(), "sweep.json", &sweep.to_string());
    let id = ends(url, &["submit", &file, "--name", "three", "-q"], 0)
        .await
        .0
        .trim()
        .to_owned();
    assert!(id.starts_with("sweep_"), "{id}");
    let (watched, _) = ends(url, &["watch", &id], 0).await;
    assert!(watched.contains("3 of 3 members succeeded"), "{watched}");
    ends(url, &["wait", &id], 0).await;
    let (table, _) = ends(url, &["result", &id], 0).await;
    assert_eq!(table.lines().count(), 4, "{table}");
    let (card, _) = ends(url, &["get", &id], 0).await;
    assert!(
        card.contains("/contacts/0/friction/coefficient") && card.contains("3 succeeded"),
        "{card}"
    );
    let (listed, _) = ends(url, &["ls", "--sweeps"], 0).await;
    assert!(
        listed.contains(&id) && listed.contains("3 of 3 members"),
        "{listed}"
    );
    let saved = folder.path().join("table.csv");
    ends(url, &["result", &id, "-o", saved.to_str().unwrap()], 0).await;
    assert_eq!(std::fs::read_to_string(saved).unwrap(), table);
    let (text, _) = ends(url, &["result", &id, "-o", "-"], 0).await;
    let (same, _) = ends(url, &["result", &id, "-f", "json"], 0).await;
    assert!(text == same && !Path::new("-").exists());
    ends(url, &["plot", &id], 2).await;
    ends(url, &["rm", &id], 0).await;
    ends(url, &["get", &id], 6).await;
}

/// The service has JSON by pages of 1,000 members at most; the command has all of them.
#[tokio::test]
async fn a_table_of_many_members_is_whole_in_json() {
    let server = server().await;
    let folder = tempfile::tempdir().unwrap();
    let url = &server.url;
    problem(folder.path(), "sheet");
    let values: Vec<f64> = (0..1001).map(|number| f64::from(number) * 4e-4).collect();
    let sweep = json!({
        "base": "sheet.json",
        "axes": [{ "path": "/contacts/0/friction/coefficient", "values": values }],
    });
    let file = write(folder.path(), "sweep.json", &sweep.to_string());
    let id = ends(url, &["submit", &file, "-q"], 0).await.0;
    let id = id.trim();
    ends(url, &["wait", id], 0).await;
    let saved = folder.path().join("table.json");
    ends(url, &["result", id, "-o", saved.to_str().unwrap()], 0).await;
    let text = std::fs::read_to_string(saved).unwrap();
    let table: Value = serde_json::from_str(&text).unwrap();
    let members = table["members"].as_array().unwrap();
    let numbers: Vec<i64> = members
        .iter()
        .map(|member| member["number"].as_i64().unwrap())
        .collect();
    assert_eq!(numbers, (0..1001).collect::<Vec<_>>());
}

#[tokio::test]
async fn shells_and_manuals_know_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let (script, _) = ends("", &["completions", shell], 0).await;
        assert!(
            ["submit", "watch", "queue-ttl"]
                .iter()
                .all(|word| script.contains(word)),
            "{shell}"
        );
    }
    let path = folder.path().to_str().unwrap();
    ends("", &["man", path], 0).await;
    for page in [
        "signorini.1",
        "signorini-submit.1",
        "signorini-token-create.1",
        "signorini-config-show.1",
    ] {
        let text = std::fs::read_to_string(folder.path().join(page)).unwrap();
        assert!(
            text.contains(".SH NAME") && text.contains(".SH OPTIONS"),
            "{page}\n{text}"
        );
    }
    let (page, _) = ends("", &["man"], 0).await;
    assert!(page.contains("signorini"), "{page}");
    ends("", &["man", &format!("{path}/none")], 1).await;
}
