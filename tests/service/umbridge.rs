//! The protocol of UM-Bridge: outputs, derivatives, its errors, and what evaluations share with other jobs.
//! `tests/clients/umbridge.py` has a client of others, and the protocol check by check.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use suite::{
    example_json,
    harness::{Server, answer, soon},
};

use crate::{
    SIGNORINI,
    models::{punch, put},
    server,
};

async fn ask(server: &Server, endpoint: &str, body: Value) -> (StatusCode, Value) {
    answer(server.post(&format!("/umbridge/{endpoint}")).json(&body)).await
}

/// The answer to a request that succeeds.
async fn output(server: &Server, endpoint: &str, body: Value) -> Value {
    let (status, mut answer) = ask(server, endpoint, body).await;
    assert_eq!(status, StatusCode::OK, "{endpoint}: {answer:#}");
    answer["output"].take()
}

/// The type and the message of an error of the protocol, which has nothing beside them.
async fn refused(server: &Server, endpoint: &str, body: Value) -> (StatusCode, String, String) {
    let (status, document) = ask(server, endpoint, body).await;
    let fields: Vec<&String> = document.as_object().unwrap().keys().collect();
    assert_eq!(fields, ["error"], "{document:#}");
    let error = document["error"].as_object().unwrap();
    assert_eq!(error.len(), 2, "{document:#}");
    let text = |name: &str| error[name].as_str().unwrap().to_owned();
    (status, text("type"), text("message"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|number| number.as_f64().unwrap())
        .collect()
}

/// Operations: UmBridgeInfo, UmBridgeModelInfo, UmBridgeInputSizes, UmBridgeOutputSizes, UmBridgeEvaluate
#[tokio::test]
async fn an_evaluation_has_the_numbers_of_the_same_problem_submitted_as_a_job() {
    let server = server().await;
    put(&server, "punch", &punch()).await;
    let info = server.json("/umbridge/Info").await;
    assert_eq!(info, json!({ "protocolVersion": 1.0, "models": ["punch"] }));
    assert!(info["protocolVersion"].is_f64());
    let named = json!({ "name": "punch", "config": {} });
    let sizes = ask(&server, "InputSizes", named.clone()).await.1;
    assert_eq!(sizes, json!({ "inputSizes": [1, 2] }));
    let sizes = ask(&server, "OutputSizes", named.clone()).await.1;
    assert_eq!(sizes, json!({ "outputSizes": [2, 5] }));
    let support = ask(&server, "ModelInfo", named).await.1;
    let all =
        json!({ "Evaluate": true, "Gradient": true, "ApplyJacobian": true, "ApplyHessian": false });
    assert_eq!(support, json!({ "support": all }));

    let input = json!([[0.2], [1500, 0.3]]);
    let found = output(
        &server,
        "Evaluate",
        json!({ "name": "punch", "input": input }),
    )
    .await;
    let mut problem = punch()["problem"].take();
    problem["contacts"][0]["indentation"] = json!(0.2);
    problem["materials"][0]["youngs_modulus"] = json!(1500);
    // solved anew: not from the cache
    let job = server.submit(&problem).await;
    server.until_done(&job).await;
    let summary = server.json(&format!("/v1/jobs/{job}/result")).await["summary"].take();
    let profile = server
        .json(&format!("/v1/jobs/{job}/profiles/top?points=5"))
        .await;
    let expected = json!([
        [
            summary["normal_force"],
            summary["contacts"]["top"]["peak_normal_stress"]["value"]
        ],
        profile["normal_stress"],
    ]);
    assert_eq!(found, expected, "to the last bit");
    assert!(numbers(&found[0])[0] > 100.0);

    // it was a job like any other, and is answered from the cache when it is asked again
    let input = json!([[0.2], [1500.0, 0.3]]);
    assert_eq!(
        output(
            &server,
            "Evaluate",
            json!({ "name": "punch", "input": input, "config": null })
        )
        .await,
        found
    );
    let jobs = server.json("/v1/jobs?label.model=punch").await["jobs"].take();
    let jobs = jobs.as_array().unwrap();
    assert_eq!((jobs.len(), &jobs[0]["name"]), (2, &json!("model punch")));
    assert_eq!(jobs[0]["input_hash"], jobs[1]["input_hash"]);
    assert!(jobs[0]["cached_from"].is_string(), "{:#}", jobs[0]);
    assert_eq!(jobs[0]["input_hash"], server.job(&job).await["input_hash"]);
}

/// The force is proportional to indentation and to Young's modulus, so that its derivatives are known.
/// Operations: UmBridgeGradient, UmBridgeApplyJacobian
#[tokio::test]
async fn derivatives_are_those_that_are_known() {
    let server = server().await;
    put(&server, "punch", &punch()).await;
    let (depth, modulus) = (0.2, 1500.0);
    let at = json!([[depth], [modulus, 0.3]]);
    let body = |more: Value| {
        let mut body =
            json!({ "name": "punch", "input": at, "outWrt": 0, "inWrt": 0, "config": {} });
        body.as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        body
    };
    let found = output(&server, "Evaluate", json!({ "name": "punch", "input": at })).await;
    let (force, stress) = (numbers(&found[0])[0], numbers(&found[0])[1]);
    let close = |found: &Value, expected: &[f64]| {
        let found = numbers(found);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() <= 1e-6 * expected.abs(),
                "{found} instead of {expected}"
            );
        }
    };
    let gradient = async |more| output(&server, "Gradient", body(more)).await;
    close(&gradient(json!({ "sens": [1, 0] })).await, &[force / depth]);
    close(
        &gradient(json!({ "sens": [0.5, 2.0] })).await,
        &[(0.5 * force + 2.0 * stress) / depth],
    );
    let jacobian = async |more| output(&server, "ApplyJacobian", body(more)).await;
    close(
        &jacobian(json!({ "vec": [3] })).await,
        &[3.0 * force / depth, 3.0 * stress / depth],
    );
    assert_eq!(jacobian(json!({ "vec": [0] })).await, json!([0.0, 0.0]));
    // of the profile, by the first number of the other vector
    let of_profile = jacobian(json!({ "outWrt": 1, "inWrt": 1, "vec": [1, 0] })).await;
    let expected: Vec<f64> = numbers(&found[1])
        .iter()
        .map(|stress| stress / modulus)
        .collect();
    close(&of_profile, &expected);
}

/// The end of the obstacle is at a node: a step to one side leaves out an edge of the contact.
/// Operations: UmBridgeGradient, UmBridgeApplyJacobian
#[tokio::test]
async fn a_difference_of_two_meshes_is_no_derivative() {
    let server = server().await;
    let mut model = punch();
    model["inputs"] = json!([["/contacts/0/obstacle/to"]]);
    put(&server, "edge", &model).await;
    let at = model["problem"]["contacts"][0]["obstacle"]["to"].clone();
    for (endpoint, with) in [
        ("Gradient", json!({ "sens": [1, 0] })),
        ("ApplyJacobian", json!({ "vec": [1] })),
    ] {
        let mut body = json!({ "name": "edge", "input": [[at]], "outWrt": 0, "inWrt": 0 });
        let fields = body.as_object_mut().unwrap();
        fields.extend(with.as_object().unwrap().clone());
        let (status, kind, message) = refused(&server, endpoint, body).await;
        assert_eq!(
            (status, kind.as_str()),
            (StatusCode::BAD_REQUEST, "UnsupportedFeature"),
            "{message}"
        );
        // the mesh is the same, the contact boundary is not
        let numbers: Vec<&str> = message
            .split(|c: char| !c.is_ascii_digit())
            .filter(|word| !word.is_empty())
            .collect();
        let all = numbers.join(" ");
        assert!(message.contains(" unknowns ("), "{message}");
        let on_contacts = message.split('(').nth(1).unwrap();
        let (one, other) = on_contacts.split_once(" and ").unwrap();
        assert!(!other.starts_with(one), "{all}: {message}");
    }
}

/// Operations: UmBridgeModelInfo, UmBridgeGradient, UmBridgeApplyJacobian, UmBridgeApplyHessian
#[tokio::test]
async fn what_a_model_does_not_support_is_refused_as_unsupported() {
    let server = server().await;
    let mut model = punch();
    model["problem"]["contacts"][0]["indentation"] = json!(0);
    put(&server, "flat", &model).await;
    let info = ask(&server, "ModelInfo", json!({ "name": "flat" })).await.1;
    assert_eq!(
        (&info["support"]["Evaluate"], &info["support"]["Gradient"]),
        (&json!(true), &json!(false))
    );
    for endpoint in ["Gradient", "ApplyJacobian", "ApplyHessian"] {
        // before anything else is read
        let (status, kind, message) = refused(&server, endpoint, json!({ "name": "flat" })).await;
        assert_eq!(
            (status, kind.as_str()),
            (StatusCode::BAD_REQUEST, "UnsupportedFeature"),
            "{message}"
        );
    }
}

/// Operations: UmBridgeEvaluate, UmBridgeGradient, UmBridgeApplyJacobian, UmBridgeInputSizes
#[tokio::test]
async fn a_request_that_is_wrong_is_refused_in_the_form_of_the_protocol() {
    let server = server().await;
    put(&server, "punch", &punch()).await;
    let good = || json!({ "name": "punch", "input": [[0.2], [1000, 0.3]], "outWrt": 0, "inWrt": 0, "sens": [1, 0], "vec": [1] });
    let with = |name: &str, value: Value| {
        let mut body = good();
        body[name] = value;
        body
    };
    for (endpoint, body, kind, fragment) in [
        (
            "Evaluate",
            json!({ "name": "press" }),
            "ModelNotFound",
            "the latest are: punch",
        ),
        (
            "InputSizes",
            json!({ "name": "press" }),
            "ModelNotFound",
            "press",
        ),
        ("InputSizes", json!({}), "InvalidInput", "name is missing"),
        (
            "InputSizes",
            json!({ "name": 7 }),
            "InvalidInput",
            "name: expected",
        ),
        (
            "Evaluate",
            json!({ "name": "punch" }),
            "InvalidInput",
            "input is missing",
        ),
        (
            "Evaluate",
            with("input", json!([[0.2]])),
            "InvalidInput",
            "1 vectors; the model takes 2",
        ),
        (
            "Evaluate",
            with("input", json!([[0.2, 1], [1000, 0.3]])),
            "InvalidInput",
            "input 0 has 2 numbers; expected 1",
        ),
        (
            "Evaluate",
            with("input", json!([0.2, 1000])),
            "InvalidInput",
            "a list of vectors",
        ),
        (
            "Evaluate",
            with("input", json!([["0.2"], [1000, 0.3]])),
            "InvalidInput",
            "a list of vectors",
        ),
        (
            "Evaluate",
            with("input", json!([[null], [1000, 0.3]])),
            "InvalidInput",
            "a list of vectors",
        ),
        (
            "Evaluate",
            with("config", json!({ "level": 1 })),
            "InvalidInput",
            "config has \"level\"",
        ),
        (
            "Evaluate",
            with("config", json!([])),
            "InvalidInput",
            "config: expected an object",
        ),
        (
            "Evaluate",
            with("inputs", json!([])),
            "InvalidInput",
            "inputs",
        ),
        (
            "Evaluate",
            with("input", json!([[0.2], [-5, 0.5]])),
            "InvalidInput",
            "/materials/0/youngs_modulus",
        ),
        (
            "Gradient",
            with("outWrt", json!(2)),
            "InvalidInput",
            "outWrt is 2; expected 0 … 1",
        ),
        (
            "Gradient",
            with("inWrt", json!(-1)),
            "InvalidInput",
            "inWrt is -1; expected 0 … 1",
        ),
        (
            "Gradient",
            with("inWrt", json!(0.5)),
            "InvalidInput",
            "inWrt: expected",
        ),
        (
            "Gradient",
            with("sens", json!([1])),
            "InvalidInput",
            "sens has 1 numbers; expected 2",
        ),
        (
            "Gradient",
            with("input", json!([[], []])),
            "InvalidInput",
            "input 0 has 0 numbers",
        ),
        (
            "ApplyJacobian",
            with("vec", json!([1, 2])),
            "InvalidInput",
            "vec has 2 numbers; expected 1",
        ),
        (
            "ApplyJacobian",
            with("vec", json!([1e308])),
            "InvalidInput",
            "vec is too large",
        ),
    ] {
        let (status, found, message) = refused(&server, endpoint, body.clone()).await;
        assert_eq!(
            (status, found.as_str()),
            (StatusCode::BAD_REQUEST, kind),
            "{endpoint} {body}: {message}"
        );
        assert!(message.contains(fragment), "{endpoint} {body}: {message}");
    }
    // whatever the type is declared as, and whatever the text is
    for (text, fragment) in [
        ("", "expected a JSON object"),
        ("{\"name\": \"punch\"", "cannot be read"),
        ("[\"punch\"]", "expected a JSON object"),
        (
            "{\"name\": \"punch\", \"input\": [[NaN], [1000, 0.3]]}",
            "cannot be read",
        ),
        (
            "{\"name\": \"punch\", \"input\": [[1e999], [1000, 0.3]]}",
            "a list of vectors",
        ),
        ("{\"name\": \"punch\", \"name\": \"punch\"}", "duplicate"),
    ] {
        let (status, document) = answer(server.post("/umbridge/Evaluate").body(text)).await;
        assert_eq!(status, StatusCode::BAD_REQUEST);
        assert_eq!(document["error"]["type"], "InvalidInput");
        let message = document["error"]["message"].as_str().unwrap();
        assert!(message.contains(fragment), "{text}: {message}");
    }
    // what is refused before it is read is a document as elsewhere, with that form in it
    let (status, document) = answer(server.post("/umbridge/Evaluate?x=1").body("{}")).await;
    assert_eq!(
        (status, &document["code"]),
        (StatusCode::BAD_REQUEST, &json!("unknown-parameter"))
    );
    assert_eq!(document["error"]["type"], document["code"]);
    assert_eq!(document["error"]["message"], document["detail"]);
    let large = answer(
        server
            .post("/umbridge/Evaluate")
            .body(" ".repeat((1 << 20) + 1)),
    )
    .await;
    assert_eq!(
        (large.0, &large.1["error"]["type"]),
        (StatusCode::PAYLOAD_TOO_LARGE, &json!("payload-too-large"))
    );
    let from_elsewhere = server
        .post("/umbridge/Evaluate")
        .header("Origin", "http://elsewhere.example")
        .body("{}");
    assert_eq!(answer(from_elsewhere).await.0, StatusCode::FORBIDDEN);
    // nothing of all this was submitted
    assert_eq!(server.json("/v1/jobs/count").await["total"], 0);
}

/// Operations: UmBridgeEvaluate, UmBridgeGradient
#[tokio::test]
async fn without_a_solution_there_is_an_error_with_the_job_and_never_a_number() {
    let server = server().await;
    let problem = |change: &dyn Fn(&mut Value)| {
        let mut problem = example_json("rectangular_punch");
        change(&mut problem);
        json!({
            "problem": problem,
            "inputs": [["/contacts/0/indentation", "/contacts/0/friction/coefficient"]],
            "outputs": [{ "scalars": ["normal_force", "contacts/top/peak_normal_stress"] }],
        })
    };
    put(
        &server,
        "hasty",
        &problem(&|problem| problem["solver"] = json!({ "max_iterations": 1 })),
    )
    .await;
    put(&server, "punch", &problem(&|_| ())).await;
    let job = async |name: &str| {
        let jobs = server.json(&format!("/v1/jobs?label.model={name}")).await;
        jobs["jobs"][0]["id"].as_str().unwrap().to_owned()
    };
    let at = |name: &str, input: [f64; 2]| json!({ "name": name, "input": [input] });
    let (status, kind, message) = refused(&server, "Evaluate", at("hasty", [0.25, 0.3])).await;
    assert_eq!(
        (status, kind.as_str()),
        (StatusCode::INTERNAL_SERVER_ERROR, "InvalidOutput")
    );
    assert!(
        message.contains(&job("hasty").await) && message.contains("not-converged"),
        "{message}"
    );
    // without contact there is no peak, and the force alone is not answered instead
    let (status, kind, message) = refused(&server, "Evaluate", at("punch", [-0.1, 0.3])).await;
    assert_eq!(
        (status, kind.as_str()),
        (StatusCode::INTERNAL_SERVER_ERROR, "InvalidOutput")
    );
    assert!(
        message.contains(&job("punch").await) && message.contains("peak_normal_stress"),
        "{message}"
    );
    // a step of a difference may leave what a problem allows
    let mut body = at("punch", [0.25, 0.0]);
    body.as_object_mut().unwrap().extend(
        json!({ "outWrt": 0, "inWrt": 0, "sens": [1, 0] })
            .as_object()
            .unwrap()
            .clone(),
    );
    let (_, kind, message) = refused(&server, "Gradient", body).await;
    assert_eq!(kind, "InvalidInput");
    assert!(
        message.contains("/contacts/0/friction/coefficient = -0.000139"),
        "{message}"
    );
}

/// Operations: UmBridgeEvaluate
#[tokio::test]
async fn a_replaced_model_is_evaluated_as_it_is_now() {
    let server = server().await;
    put(&server, "punch", &punch()).await;
    let body = json!({ "name": "punch", "input": [[0.2], [1000, 0.3]] });
    let force = async || numbers(&output(&server, "Evaluate", body.clone()).await[0])[0];
    let before = force().await;
    let mut model = punch();
    model["outputs"][0]["scalars"] = json!(["tangential_force", "normal_force"]);
    put(&server, "punch", &model).await;
    let found = output(&server, "Evaluate", body.clone()).await;
    assert_eq!(numbers(&found[0])[1], before);
    server.delete("/v1/models/punch").send().await.unwrap();
    let (_, kind, message) = refused(&server, "Evaluate", body.clone()).await;
    assert_eq!(kind, "ModelNotFound");
    assert!(message.contains("none is registered"), "{message}");
}

/// Operations: UmBridgeEvaluate
#[tokio::test]
async fn a_client_that_goes_away_leaves_its_job_in_the_queue() {
    let server = server().await;
    put(&server, "punch", &punch()).await;
    server.post("/v1/queue/pause").send().await.unwrap();
    let body = json!({ "name": "punch", "input": [[0.2], [1000, 0.3]] });
    let asked = tokio::spawn(server.post("/umbridge/Evaluate").json(&body).send());
    let id = soon("its job is submitted", async {
        loop {
            let jobs = server.json("/v1/jobs?status=queued").await;
            if let Some(id) = jobs["jobs"][0]["id"].as_str() {
                return id.to_owned();
            }
        }
    });
    let id = id.await;
    assert!(!asked.is_finished(), "nothing is solved meanwhile");
    asked.abort();
    server.post("/v1/queue/resume").send().await.unwrap();
    assert_eq!(server.until_done(&id).await["status"], "succeeded");
}

/// Operations: UmBridgeEvaluate, UmBridgeInfo
#[tokio::test]
async fn evaluations_count_for_their_owner_and_models_are_their_owners() {
    let server = Server::start(SIGNORINI, &["--max-queued-per-owner", "2"]).await;
    let token = async |admin: Option<&str>, owner: &str, scopes: &[&str]| {
        let body = json!({ "name": "test", "owner": owner, "scopes": scopes });
        let mut request = server.post("/v1/tokens").json(&body);
        if let Some(admin) = admin {
            request = request.bearer_auth(admin);
        }
        answer(request).await.1["secret"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    let admin = token(None, "root", &["admin"]).await;
    let ada = token(Some(&admin), "ada", &["read", "submit"]).await;
    let bob = token(Some(&admin), "bob", &["read", "submit"]).await;
    // as `http://anyone:TOKEN@host/umbridge` is sent, which is all that a client of UM-Bridge can be told
    let with = |method: Method, path: &str, secret: &str| {
        server
            .request(method, path)
            .basic_auth("anyone", Some(secret))
    };
    let registered = with(Method::PUT, "/v1/models/punch", &ada).json(&punch());
    assert_eq!(answer(registered).await.0, StatusCode::CREATED);
    for (secret, names) in [
        (&ada, json!(["punch"])),
        (&bob, json!([])),
        (&admin, json!(["punch"])),
    ] {
        let info = answer(with(Method::GET, "/umbridge/Info", secret)).await.1;
        assert_eq!(info["models"], names);
    }
    let body = json!({ "name": "punch", "input": [[0.2], [1000, 0.3]], "outWrt": 0, "inWrt": 1, "sens": [1, 0] });
    let (_, refused) = answer(with(Method::POST, "/umbridge/Evaluate", &bob).json(&body)).await;
    assert_eq!(refused["error"]["type"], "ModelNotFound");
    // four jobs at once, of which two may wait
    let paused = with(Method::POST, "/v1/queue/pause", &admin)
        .send()
        .await
        .unwrap();
    assert_eq!(paused.status(), StatusCode::OK);
    let (status, refused) =
        answer(with(Method::POST, "/umbridge/Gradient", &ada).json(&body)).await;
    assert_eq!(
        (status, &refused["code"]),
        (StatusCode::TOO_MANY_REQUESTS, &json!("quota-exceeded"))
    );
    assert_eq!(refused["error"]["type"], "quota-exceeded");
    assert!(
        refused["error"]["message"]
            .as_str()
            .unwrap()
            .contains("ada has 0 jobs in the queue of at most 2")
    );
    assert_eq!(
        answer(with(Method::GET, "/v1/jobs/count", &ada)).await.1["total"],
        0,
        "all or none"
    );
    let refused = answer(server.get("/umbridge/Info")).await;
    assert_eq!(
        (refused.0, &refused.1["error"]["type"]),
        (StatusCode::UNAUTHORIZED, &json!("unauthenticated"))
    );
}
