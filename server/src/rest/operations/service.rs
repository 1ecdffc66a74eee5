//! The problem on its own, queue, errors, the description of the API, and the probes.

use super::{
    Operation, get, post,
    shapes::{bytes, json, submission},
};
use crate::{
    catalog::{Code, Kind},
    rest::{bodies::BareProblem, docs, openapi, service, submit},
    verbs::{
        problems::Judgement,
        queue::{Caller, Info, QueueState},
    },
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post("/v1/problems/validate", submit::validate)
            .rpcs(&["ValidateProblem"])
            .says("Checks a problem and estimates its cost; stores nothing, and answers for an invalid one too")
            .takes(json::<BareProblem>())
            .for_example(submission())
            .answers(200, "All that there is to say of it", json::<Judgement>())
            .fails(&[Code::InvalidProblem])
            .tested(&["service::validate::a_good_problem_is_valid_and_has_a_price", "service::validate::a_bad_problem_is_an_answer_and_not_an_error"]),
        get("/v1/queue", service::queue)
            .rpcs(&["GetQueue"])
            .says("How the queue stands")
            .answers(200, "How it stands", json::<QueueState>())
            .tested(&["service::control::a_paused_queue_accepts_and_does_not_start"]),
        post("/v1/queue/pause", service::pause)
            .rpcs(&["PauseQueue"])
            .says("Lets no job start until the queue is resumed, also after a restart; what runs goes on")
            .answers(200, "How the queue stands", json::<QueueState>())
            .fails(&[Code::StorageFull])
            .tested(&["service::control::a_paused_queue_accepts_and_does_not_start"]),
        post("/v1/queue/resume", service::resume)
            .rpcs(&["ResumeQueue"])
            .says("Lets jobs start again")
            .answers(200, "How the queue stands", json::<QueueState>())
            .fails(&[Code::StorageFull])
            .tested(&["service::control::a_paused_queue_accepts_and_does_not_start"]),
        get("/v1/info", service::info)
            .rpcs(&["GetServerInfo"])
            .says("What this service is, and what it takes at most")
            .answers(200, "What it is", json::<Info>())
            .tested(&["service::same_errors::what_both_protocols_answer_about_the_service_is_the_same"]),
        get("/v1/me", service::me)
            .rpcs(&["GetCaller"])
            .says("Who asks, and what he may do")
            .answers(200, "Who", json::<Caller>())
            .tested(&["service::same_errors::what_both_protocols_answer_about_the_service_is_the_same"]),
        get("/v1/errors/{code}", service::error)
            .rest_only("GetError")
            .says("What a kind of error means and what to do, for programs or as a page")
            .answers(200, "What it means", [json::<Kind>(), bytes("text/html")].concat())
            .tested(&["service::description::every_error_has_its_page_for_programs_and_for_people"]),
        get("/v1/schema/problem.json", service::schema)
            .rest_only("GetProblemSchema")
            .says("The JSON Schema of a problem: every name, what it means and its default")
            .answers(200, "The schema", bytes("application/json"))
            .tested(PROBES),
        get("/openapi.json", openapi::serve)
            .rest_only("GetOpenApi")
            .says("This description of the API over REST")
            .answers(200, "An OpenAPI document", bytes("application/json"))
            .tested(&["service::description::the_description_is_whole_and_says_what_each_error_is", "tests/contract.py"]),
        get("/proto/signorini.proto", service::proto)
            .rest_only("GetProto")
            .says("The description of the API over gRPC")
            .answers(200, "The protocol buffers", bytes("text/plain"))
            .tested(&["service::description::the_contract_of_grpc_is_served_as_it_was_written"]),
        get("/docs", docs::page)
            .rest_only("GetDocs")
            .says("A page that shows this description, and can try it out; it works offline")
            .answers(200, "The page", bytes("text/html"))
            .tested(PAGE),
        get("/docs/{file}", docs::file)
            .rest_only("GetDocsFile")
            .says("What that page loads")
            .answers(200, "The file", PARTS.map(bytes).concat())
            .tested(PAGE),
        get("/livez", service::livez)
            .rest_only("Live")
            .says("The process is alive")
            .lenient()
            .answers(200, "ok", bytes("text/plain"))
            .tested(PROBES),
        get("/readyz", service::readyz)
            .rest_only("Ready")
            .says("The service takes jobs")
            .lenient()
            .answers(200, "ok", bytes("text/plain"))
            .fails(&[Code::Draining])
            .tested(PROBES),
    ]
}

const PAGE: &[&str] =
    &["service::description::the_page_of_the_api_loads_from_here_and_from_nowhere_else"];
const PARTS: [&str; 3] = ["text/css", "text/javascript", "text/plain"];
const PROBES: &[&str] = &["service::errors::the_probes_and_the_schema_answer"];
