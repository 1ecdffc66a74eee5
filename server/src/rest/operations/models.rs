//! Parametrised problems, which clients of UM-Bridge evaluate.

use serde_json::{Value, json as value};

use super::{
    content::{self, json, nothing},
    headers::location,
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, put},
};
use crate::{
    catalog::Code,
    model::{Model, WholeModel},
    rest::{model_body::ModelSubmission, models},
    verbs::{
        models::NAME,
        page::{PAGE_SIZE, PAGE_TOKEN},
    },
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        put(SUBMIT, "/v1/models/{name}", (NAME,), models::put)
            .rest_only("PutModel")
            .summary("Registers a model, or replaces the caller's own of that name; at most 100 of each owner")
            .body(json::<ModelSubmission>())
            .example(example())
            .answers(200, "The model that was replaced, as it is now", json::<Model>())
            .with([location()])
            .answers(201, "A new model", json::<Model>())
            .with([location()])
            .fails(&[Code::InvalidProblem, Code::ProblemTooLarge, Code::QuotaExceeded, Code::Draining, Code::StorageFull]),
        get(READ, "/v1/models", (PAGE_SIZE, PAGE_TOKEN), models::list)
            .rest_only("ListModels")
            .summary("Lists models, newest first, without their problems")
            .answers(200, "A page of models", json::<models::List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/models/{name}", (NAME,), models::get)
            .rest_only("GetModel")
            .summary("Returns a model with its problem; to an administrator their own of that name, or else the oldest")
            .answers(200, "The model", json::<WholeModel>()),
        delete(CANCEL, "/v1/models/{name}", (NAME,), models::delete)
            .rest_only("DeleteModel")
            .summary("Deletes the model that GET returns; its jobs stay")
            .answers(204, "It is deleted", nothing())
            .fails(&[Code::StorageFull]),
    ]
}

/// A body that registers a model, as an example.
fn example() -> Value {
    value!({
        "problem": content::submission()["problem"],
        "inputs": [["/contacts/0/indentation", "/contacts/0/friction/coefficient"]],
        "outputs": [
            { "scalars": ["normal_force", "contacts/top/peak_tangential_stress"] },
            { "profile": "top", "quantity": "normal_stress", "points": 50 },
        ],
    })
}
