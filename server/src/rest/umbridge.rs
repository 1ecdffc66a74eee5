//! `/umbridge`: the protocol of UM-Bridge, version 1.0, over the models of `/v1/models`.
//!
//! Its clients need not declare their bodies as JSON, so none is refused for its type. An error of the protocol has the
//! form and the status that it defines; any other is a document as elsewhere, to which `reply` adds that form.

use std::{borrow::Cow, collections::BTreeMap};

use axum::{
    Json,
    http::StatusCode,
    response::{IntoResponse, Response},
};
use schemars::JsonSchema;
use serde::{
    Deserialize, Serialize,
    de::{DeserializeOwned, IgnoredAny},
};
use serde_json::value::RawValue;
use solver::error::shortened;

use super::{call::Call, refused};
use crate::{
    error::ApiError,
    model::Model,
    verbs::umbridge::{self as verbs, Kind, ModelError, Pair, With, invalid},
    violations::quoted,
};

/// Largest body of a request: thousands of numbers, where a model has at most 64 inputs.
const MOST_BYTES: usize = 1 << 20;

/// The server.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
#[schemars(rename = "UmBridgeInfo")]
pub(super) struct Info {
    /// Version of the protocol.
    protocol_version: f64,
    /// The names of the caller's models.
    models: Vec<String>,
}

/// What a model supports.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "UmBridgeModelInfo")]
pub(super) struct ModelInfo {
    /// Each feature of the protocol.
    support: Support,
}

/// Each feature of the protocol, and whether a model supports it.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "PascalCase")]
#[schemars(rename = "UmBridgeSupport")]
struct Support {
    /// Always.
    evaluate: bool,
    /// By central differences, unless the problem of the model has 0 at an input.
    gradient: bool,
    /// As the gradient.
    apply_jacobian: bool,
    /// Never.
    apply_hessian: bool,
}

/// The sizes of the vectors of inputs.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
#[schemars(rename = "UmBridgeInputSizes")]
pub(super) struct InputSizes {
    /// In order.
    input_sizes: Vec<usize>,
}

/// The sizes of the vectors of outputs.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
#[schemars(rename = "UmBridgeOutputSizes")]
pub(super) struct OutputSizes {
    /// In order.
    output_sizes: Vec<usize>,
}

/// The outputs of a model.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "UmBridgeOutput")]
pub(super) struct Outputs {
    /// In order.
    output: Vec<Vec<f64>>,
}

/// A derivative.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "UmBridgeDerivative")]
pub(super) struct Derivative {
    /// In order.
    output: Vec<f64>,
}

/// An error of the protocol.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "UmBridgeError")]
pub(super) struct Refused {
    /// What went wrong.
    error: Told,
}

/// What went wrong.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "UmBridgeErrorContent")]
struct Told {
    /// ModelNotFound, InvalidInput, UnsupportedFeature or InvalidOutput.
    r#type: &'static str,
    /// What happened in this case.
    message: String,
}

/// A body that names a model; for its schema only, as the others below: their fields are read one by one.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields, rename = "UmBridgeModelRequest")]
#[allow(dead_code)]
pub(super) struct ModelRequest {
    /// Name of the model.
    name: String,
    /// Empty: no model has options.
    #[schemars(default, extend("maxProperties" = 0))]
    config: Option<BTreeMap<String, bool>>,
}

/// A body that asks for outputs; for its schema only.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields, rename = "UmBridgeEvaluateRequest")]
#[allow(dead_code)]
pub(super) struct EvaluateRequest {
    /// Name of the model.
    name: String,
    /// A number for each pointer of each vector of inputs.
    input: Vec<Vec<f64>>,
    /// Empty: no model has options.
    #[schemars(default, extend("maxProperties" = 0))]
    config: Option<BTreeMap<String, bool>>,
}

/// A body that asks for a gradient; for its schema only.
#[derive(JsonSchema)]
#[schemars(
    deny_unknown_fields,
    rename_all = "camelCase",
    rename = "UmBridgeGradientRequest"
)]
#[allow(dead_code)]
pub(super) struct GradientRequest {
    /// Name of the model.
    name: String,
    /// The vector of outputs, from 0.
    out_wrt: u32,
    /// The vector of inputs, from 0.
    in_wrt: u32,
    /// A number for each pointer of each vector of inputs.
    input: Vec<Vec<f64>>,
    /// The derivatives of an objective by that vector of outputs.
    sens: Vec<f64>,
    /// Empty: no model has options.
    #[schemars(default, extend("maxProperties" = 0))]
    config: Option<BTreeMap<String, bool>>,
}

/// A body that asks for a derivative along a vector; for its schema only.
#[derive(JsonSchema)]
#[schemars(
    deny_unknown_fields,
    rename_all = "camelCase",
    rename = "UmBridgeJacobianRequest"
)]
#[allow(dead_code)]
pub(super) struct JacobianRequest {
    /// Name of the model.
    name: String,
    /// The vector of outputs, from 0.
    out_wrt: u32,
    /// The vector of inputs, from 0.
    in_wrt: u32,
    /// A number for each pointer of each vector of inputs.
    input: Vec<Vec<f64>>,
    /// The direction, in that vector of inputs.
    vec: Vec<f64>,
    /// Empty: no model has options.
    #[schemars(default, extend("maxProperties" = 0))]
    config: Option<BTreeMap<String, bool>>,
}

/// All fields that requests of the protocol have, as text: each operation reads its own.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
struct Fields<'a> {
    #[serde(borrow)]
    name: Option<&'a RawValue>,
    #[serde(borrow)]
    config: Option<&'a RawValue>,
    #[serde(borrow)]
    input: Option<&'a RawValue>,
    #[serde(borrow)]
    out_wrt: Option<&'a RawValue>,
    #[serde(borrow)]
    in_wrt: Option<&'a RawValue>,
    #[serde(borrow)]
    sens: Option<&'a RawValue>,
    #[serde(borrow)]
    vec: Option<&'a RawValue>,
    // of ApplyHessian, which no model supports
    #[allow(dead_code)]
    in_wrt1: Option<IgnoredAny>,
    #[allow(dead_code)]
    in_wrt2: Option<IgnoredAny>,
}

impl<'a> Fields<'a> {
    fn read(text: &'a str) -> Result<Self, ModelError> {
        // serde would also take a list of the fields in order
        if !text.trim_start().starts_with('{') {
            let got = quoted(text.trim());
            return Err(invalid(format!("expected a JSON object, got {got:?}")));
        }
        let read = serde_json::from_str(text);
        read.map_err(|error| invalid(shortened(&format!("the body cannot be read: {error}"), 300)))
    }

    fn name(&self) -> Result<String, ModelError> {
        value("name", self.name, "the name of a model")
    }

    /// An error if there are options: they would have no effect.
    fn without_options(&self) -> Result<(), ModelError> {
        let Some(raw) = self.config else {
            return Ok(());
        };
        let options: BTreeMap<Cow<'_, str>, IgnoredAny> = value("config", Some(raw), "an object")?;
        match options.keys().next() {
            None => Ok(()),
            Some(first) => Err(invalid(format!(
                "config has {:?}; no model has options, so that it is left out or {{}}",
                quoted(first)
            ))),
        }
    }

    fn input(&self) -> Result<Vec<Vec<f64>>, ModelError> {
        value(
            "input",
            self.input,
            "a list of vectors, each a list of finite numbers",
        )
    }

    fn pair(&self) -> Result<Pair, ModelError> {
        let index = "the number of a vector, from 0";
        Ok(Pair {
            out_wrt: value("outWrt", self.out_wrt, index)?,
            in_wrt: value("inWrt", self.in_wrt, index)?,
        })
    }
}

/// A field of the body.
fn value<T: DeserializeOwned>(
    name: &str,
    raw: Option<&RawValue>,
    expected: &str,
) -> Result<T, ModelError> {
    let Some(raw) = raw else {
        return Err(invalid(format!("{name} is missing; expected {expected}")));
    };
    serde_json::from_str(raw.get()).map_err(|_| {
        let got = quoted(raw.get());
        invalid(format!("{name}: expected {expected}, got {got}"))
    })
}

/// The body as text. It is malformed JSON if it is no text at all.
async fn text(call: &mut Call) -> Result<String, ModelError> {
    let limit_bytes = MOST_BYTES.min(call.service.max_body_bytes);
    call.text(limit_bytes).await.map_err(|error| match error {
        ApiError::MalformedJson(why) => invalid(why),
        other => other.into(),
    })
}

/// The answer, or the error in the form that it has.
fn answer<T: Serialize>(answered: Result<T, ModelError>) -> Result<Response, ApiError> {
    match answered {
        Ok(answer) => Ok(Json(answer).into_response()),
        Err(ModelError::Service(error)) => Err(error),
        Err(ModelError::Protocol(kind, message)) => {
            // as the protocol has it: errors of the client, and of the model
            let status = match kind {
                Kind::ModelNotFound | Kind::InvalidInput | Kind::UnsupportedFeature => {
                    StatusCode::BAD_REQUEST
                }
                Kind::InvalidOutput => StatusCode::INTERNAL_SERVER_ERROR,
            };
            let r#type: &'static str = kind.into();
            refused::note(r#type, "/umbridge");
            let error = Told { r#type, message };
            Ok((status, Json(Refused { error })).into_response())
        }
    }
}

pub(super) async fn info(call: Call) -> Result<Json<Info>, ApiError> {
    Ok(Json(Info {
        protocol_version: 1.0,
        models: verbs::names(&call.service, &call.caller).await?,
    }))
}

pub(super) async fn model_info(call: Call) -> Result<Response, ApiError> {
    let of = |model: Model| {
        let differences = model.description.has_differences();
        let support = Support {
            evaluate: true,
            gradient: differences,
            apply_jacobian: differences,
            apply_hessian: false,
        };
        ModelInfo { support }
    };
    answer(described(call).await.map(of))
}

pub(super) async fn input_sizes(call: Call) -> Result<Response, ApiError> {
    answer(described(call).await.map(|model| InputSizes {
        input_sizes: model.description.input_sizes(),
    }))
}

pub(super) async fn output_sizes(call: Call) -> Result<Response, ApiError> {
    answer(described(call).await.map(|model| OutputSizes {
        output_sizes: model.description.output_sizes(),
    }))
}

/// The model that a request names.
async fn described(mut call: Call) -> Result<Model, ModelError> {
    let text = text(&mut call).await?;
    let fields = Fields::read(&text)?;
    let model = verbs::model(&call.service, &call.caller, &fields.name()?).await?;
    fields.without_options()?;
    Ok(model)
}

pub(super) async fn evaluate(call: Call) -> Result<Response, ApiError> {
    answer(evaluated(call).await)
}

async fn evaluated(mut call: Call) -> Result<Outputs, ModelError> {
    let (name, input) = {
        let text = text(&mut call).await?;
        let fields = Fields::read(&text)?;
        let model = verbs::model(&call.service, &call.caller, &fields.name()?).await?;
        fields.without_options()?;
        let input = fields.input()?;
        verbs::check_input(&model.description, &input)?;
        (model.name, input)
    };
    // to wait for the end of jobs takes little memory: the input is as small as the model says
    call.received.release();
    let output = verbs::evaluate(&call.service, &call.caller, &name, input).await?;
    Ok(Outputs { output })
}

pub(super) async fn gradient(call: Call) -> Result<Response, ApiError> {
    let sens = |fields: &Fields<'_>| value("sens", fields.sens, "a list of finite numbers");
    answer(differentiated(call, |fields| sens(fields).map(With::Sens)).await)
}

pub(super) async fn apply_jacobian(call: Call) -> Result<Response, ApiError> {
    let vec = |fields: &Fields<'_>| value("vec", fields.vec, "a list of finite numbers");
    answer(differentiated(call, |fields| vec(fields).map(With::Vec)).await)
}

async fn differentiated(
    mut call: Call,
    with: impl Fn(&Fields<'_>) -> Result<With, ModelError>,
) -> Result<Derivative, ModelError> {
    let (name, pair, input, with) = {
        let text = text(&mut call).await?;
        let fields = Fields::read(&text)?;
        let model = verbs::model(&call.service, &call.caller, &fields.name()?).await?;
        verbs::supports_derivatives(&model)?;
        fields.without_options()?;
        let with = with(&fields)?;
        let (pair, input) = (fields.pair()?, fields.input()?);
        verbs::check_derivative(&model.description, pair, &input, &with)?;
        (model.name, pair, input, with)
    };
    call.received.release();
    let output = verbs::derivative(&call.service, &call.caller, &name, pair, input, with).await?;
    Ok(Derivative { output })
}

pub(super) async fn apply_hessian(mut call: Call) -> Result<Response, ApiError> {
    let answered = async {
        let text = text(&mut call).await?;
        let name = Fields::read(&text)?.name()?;
        verbs::apply_hessian(&call.service, &call.caller, &name).await
    };
    answer(answered.await.map(|output| Derivative { output }))
}
