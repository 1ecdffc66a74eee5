//! A server of its own for each test, and clients that see of it what any outsider sees. Nothing
//! here knows the server's types.

use std::{
    fs::File,
    path::{Path, PathBuf},
    pin::{Pin, pin},
    process::{ExitStatus, Stdio},
    sync::{Mutex, PoisonError},
    time::Duration,
};

use eventsource_stream::Eventsource;
use futures_util::{Stream, StreamExt};
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::{
    io::{AsyncBufReadExt, BufReader},
    process::{Child, Command},
    sync::Notify,
    time::timeout,
};

/// No step of a test takes longer; a test that hangs says where.
const PATIENCE: Duration = Duration::from_secs(120);

/// Where a server listens whose port does not matter.
const ANY_PORT: &str = "127.0.0.1:0";

/// Tests that need the whole machine do not share it with others. Those who wait for all of it let others begin: a test may have a
/// part of it, and need another for a second server.
static MACHINE: Machine = Machine {
    shares: Mutex::new(0),
    changed: Notify::const_new(),
};

struct Machine {
    /// How many have a part of it; `ALL`: one has all of it.
    shares: Mutex<usize>,
    changed: Notify,
}

const ALL: usize = usize::MAX;

/// A share of the machine, or all of it.
#[derive(Debug)]
struct Share;

impl Share {
    async fn part() -> Share {
        Share::once(|shares| (shares != ALL).then(|| shares + 1)).await
    }

    async fn all() -> Share {
        Share::once(|shares| (shares == 0).then_some(ALL)).await
    }

    /// Waits until `then` gives the next number of shares.
    async fn once(then: impl Fn(usize) -> Option<usize>) -> Share {
        loop {
            let mut changed = pin!(MACHINE.changed.notified());
            changed.as_mut().enable();
            {
                let mut shares = MACHINE.shares.lock().unwrap();
                if let Some(next) = then(*shares) {
                    *shares = next;
                    return Share;
                }
            }
            changed.await;
        }
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        // also of a test that fails
        let mut shares = MACHINE
            .shares
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        *shares = if *shares == ALL { 0 } else { *shares - 1 };
        drop(shares);
        MACHINE.changed.notify_waiters();
    }
}

/// A running server and the folder that outlives it.
#[derive(Debug)]
pub struct Server {
    binary: &'static str,
    arguments: Vec<String>,
    child: Child,
    /// Where it answers.
    pub url: String,
    folder: TempDir,
    client: Client,
    _share: Share,
}

impl Server {
    /// Starts `binary` on a free port with an empty store, and waits for its address.
    pub async fn start(binary: &'static str, arguments: &[&str]) -> Server {
        let share = Share::part().await;
        Server::start_with(binary, arguments, share).await
    }

    /// The same, with no other test beside it.
    pub async fn start_alone(binary: &'static str, arguments: &[&str]) -> Server {
        let share = Share::all().await;
        Server::start_with(binary, arguments, share).await
    }

    async fn start_with(binary: &'static str, arguments: &[&str], share: Share) -> Server {
        let arguments: Vec<String> = arguments.iter().map(|text| text.to_string()).collect();
        let folder = tempfile::tempdir().unwrap();
        let (child, url) = spawn(binary, folder.path(), ANY_PORT, &arguments).await;
        Server {
            binary,
            arguments,
            child,
            url,
            folder,
            client: client(),
            _share: share,
        }
    }

    /// The folder that holds its store.
    pub fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    /// Everything it has logged.
    pub fn log(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
    }

    /// kill -9, as a crash would.
    pub async fn kill(&mut self) {
        self.child.kill().await.unwrap();
    }

    /// SIGTERM; gives what became of it.
    pub async fn terminate(&mut self) -> ExitStatus {
        let pid = self.child.id().expect("it is running");
        // of the shell: the program of that name is a package of its own
        assert!(
            Command::new("sh")
                .args(["-c", &format!("kill -TERM {pid}")])
                .status()
                .await
                .unwrap()
                .success()
        );
        soon("the server ends", self.child.wait()).await.unwrap()
    }

    /// Starts it again on the same store; the port may be another.
    pub async fn restart(&mut self) {
        self.restart_at(ANY_PORT).await;
    }

    /// The same at this address, where its clients look for it.
    pub async fn restart_at(&mut self, address: &str) {
        (self.child, self.url) =
            spawn(self.binary, self.folder.path(), address, &self.arguments).await;
    }

    /// A GET.
    pub fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(format!("{}{path}", self.url))
    }

    /// A PUT.
    pub fn put(&self, path: &str) -> RequestBuilder {
        self.request(Method::PUT, path)
    }

    /// Any other request.
    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{path}", self.url))
    }

    /// A POST.
    pub fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(format!("{}{path}", self.url))
    }

    /// The JSON at a path, which must be there.
    pub async fn json(&self, path: &str) -> Value {
        let response = self.get(path).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "GET {path}");
        response.json().await.unwrap()
    }

    /// Posts a job; gives the job as answered.
    pub async fn create_job(&self, body: &Value) -> Value {
        answer(self.post("/v1/jobs").json(body)).await.1
    }

    /// The same, and waits for the job's end.
    pub async fn solve(&self, body: &Value) -> Value {
        let request = self.post("/v1/jobs").header("Prefer", "wait=60");
        answer(request.json(body)).await.1
    }

    /// Posts a job that is solved on its own; gives its id.
    pub async fn submit(&self, problem: &Value) -> String {
        let response = self
            .post("/v1/jobs")
            .json(&json!({ "problem": problem, "cache": "off" }))
            .send()
            .await
            .unwrap();
        let status = response.status();
        let job: Value = response.json().await.unwrap();
        assert_eq!(status, StatusCode::ACCEPTED, "{job:#}");
        job["id"].as_str().unwrap().to_string()
    }

    /// The job as it is now.
    pub async fn job(&self, id: &str) -> Value {
        self.json(&format!("/v1/jobs/{id}")).await
    }

    /// A DELETE.
    pub fn delete(&self, path: &str) -> RequestBuilder {
        self.client.delete(format!("{}{path}", self.url))
    }

    /// Bytes of memory that the process has, by a name of /proc: VmRSS now, VmHWM at most.
    pub fn memory(&self, name: &str) -> u64 {
        let pid = self.child.id().expect("it is running");
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
        let line = status.lines().find(|line| line.starts_with(name)).unwrap();
        let kib: u64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
        kib * 1024
    }

    /// CPU seconds that the process has used.
    pub fn cpu_s(&self) -> f64 {
        let pid = self.child.id().expect("it is running");
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
        // user and system time, in ticks of 10 ms, behind the name in parentheses
        let fields: Vec<&str> = stat
            .rsplit(')')
            .next()
            .unwrap()
            .split_whitespace()
            .collect();
        let ticks = |k: usize| fields[k].parse::<f64>().unwrap();
        (ticks(11) + ticks(12)) / 100.0
    }

    /// Asks a job to stop; gives the outcome and the job.
    pub async fn cancel(&self, id: &str) -> Value {
        let response = self
            .post(&format!("/v1/jobs/{id}/cancel"))
            .send()
            .await
            .unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        response.json().await.unwrap()
    }

    /// The events after number `after`, as they come.
    pub async fn events(&self, id: &str, after: i64) -> Events {
        let request = self.get(&format!("/v1/jobs/{id}/events"));
        let response = request
            .header("Last-Event-ID", after.to_string())
            .send()
            .await
            .unwrap();
        assert_eq!(
            response.status(),
            StatusCode::OK,
            "events of {id} after {after}"
        );
        Events::of(response)
    }

    /// Waits until an event of the job satisfies `wanted`, and gives it.
    pub async fn until(&self, id: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let mut events = self.events(id, 0).await;
        while let Some(event) = events.next().await {
            if wanted(&event) {
                return event;
            }
        }
        panic!(
            "the events of {id} ended without the wanted one\n{}",
            self.log()
        );
    }

    /// Waits until the job is in the hands of a worker.
    pub async fn until_running(&self, id: &str) {
        self.until(id, |event| event["status"] == "running").await;
    }

    /// Waits for the job's end, and gives the terminal job.
    pub async fn until_done(&self, id: &str) -> Value {
        self.until(id, |event| event["type"] == "done").await["job"].take()
    }
}

async fn spawn(
    binary: &str,
    folder: &Path,
    address: &str,
    arguments: &[String],
) -> (Child, String) {
    let log = File::options()
        .create(true)
        .append(true)
        .open(folder.join("log"))
        .unwrap();
    let mut child = Command::new(binary)
        .args(["serve", "--listen", address, "--data"])
        .arg(folder.join("data"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(log)
        .kill_on_drop(true)
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let url = soon("the server announces its address", lines.next_line())
        .await
        .unwrap();
    (
        child,
        url.expect("the server ended before it listened; see its log"),
    )
}

/// Server-sent events, each with its `seq` checked against its id.
pub struct Events(Pin<Box<dyn Stream<Item = Value> + Send>>);

impl Events {
    fn of(response: Response) -> Events {
        let events = server_sent(response).map(|(id, data)| {
            assert_eq!(id, data["seq"].to_string());
            data
        });
        Events(Box::pin(events))
    }

    /// The next event; none when the stream has ended.
    pub async fn next(&mut self) -> Option<Value> {
        soon("the next event", self.0.next()).await
    }

    /// All that is left.
    pub async fn rest(&mut self) -> Vec<Value> {
        let mut all = vec![];
        while let Some(event) = self.next().await {
            all.push(event);
        }
        all
    }
}

impl std::fmt::Debug for Events {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Events")
    }
}

/// The server-sent events of an answer: the id of each, and its data, whose type is checked.
pub fn server_sent(response: Response) -> impl Stream<Item = (String, Value)> + Send + use<> {
    let events = response.bytes_stream().eventsource();
    // A connection that breaks ends the stream, as for any client that will come back.
    let events = events.take_while(|event| std::future::ready(event.is_ok()));
    events.map(|event| {
        let event = event.unwrap();
        let data: Value = serde_json::from_str(&event.data).unwrap();
        assert_eq!(data["type"], event.event);
        (event.id, data)
    })
}

/// A client that asks the server itself, whatever proxy the environment names.
pub fn client() -> Client {
    // reqwest wants a provider of cryptography even without TLS; an error says that there is one already
    let _ = rustls::crypto::ring::default_provider().install_default();
    let builder = Client::builder().no_proxy().tls_certs_only([]);
    builder.build().unwrap()
}

/// The status of an answer, and its JSON.
pub async fn answer(request: RequestBuilder) -> (StatusCode, Value) {
    let response = request.send().await.unwrap();
    (response.status(), response.json().await.unwrap())
}

/// What comes in time; a test that waits in vain says for what.
pub async fn soon<T>(what: &str, future: impl Future<Output = T>) -> T {
    timeout(PATIENCE, future)
        .await
        .unwrap_or_else(|_| panic!("waited in vain: {what}"))
}

/// A cylinder on a block of `nx` × `ny` equal elements, with friction.
pub fn block(nx: u32, ny: u32) -> Value {
    let lines = |n: u32, from: f64, to: f64| -> Vec<f64> {
        (0..=n)
            .map(|i| from + (to - from) * f64::from(i) / f64::from(n))
            .collect()
    };
    json!({
        "title": format!("block of {nx} x {ny} elements"),
        "analysis": { "kind": "plane_strain" },
        "mesh": { "grid": { "x": lines(nx, 0.0, 4.0), "y": lines(ny, -4.0, 0.0) } },
        "materials": [{ "youngs_modulus": 1000, "poissons_ratio": 0.3 }],
        "supports": [{ "boundary": "left", "ux": 0 }, { "boundary": "bottom", "ux": 0, "uy": 0 }],
        "contacts": [{
            "boundary": "top",
            "obstacle": { "kind": "circle", "radius": 8 },
            "indentation": 0.1,
            "friction": { "coefficient": 0.3, "nonlocal_radius": 0.05, "elastic_slip": 1e-4 }
        }]
    })
}

/// More than half a million unknowns: seconds of work.
pub fn large() -> Value {
    block(300, 280)
}
