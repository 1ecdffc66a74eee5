//! The protocol of UM-Bridge: its paths and its words.

use serde_json::json as value;

use super::{
    content::json,
    operation::{Operation, READ, READ_AND_SUBMIT, get, post},
};
use crate::{
    catalog::Code,
    rest::umbridge::{
        self as handlers, Derivative, EvaluateRequest, GradientRequest, Info, InputSizes,
        JacobianRequest, ModelInfo, ModelRequest, OutputSizes, Outputs, Refused,
    },
};

pub(super) fn operations() -> Vec<Operation> {
    let named = value!({ "name": "punch", "config": {} });
    vec![
        get(READ, "/umbridge/Info", (), handlers::info)
            .rest_only("UmBridgeInfo")
            .summary("Returns the version of the protocol, and the names of the caller's models")
            .answers(200, "Version and names", json::<Info>()),
        post(READ, "/umbridge/ModelInfo", (), handlers::model_info)
            .rest_only("UmBridgeModelInfo")
            .summary("Returns what a model supports")
            .body(json::<ModelRequest>())
            .example(named.clone())
            .answers(200, "What it supports", json::<ModelInfo>())
            .refuses(),
        post(READ, "/umbridge/InputSizes", (), handlers::input_sizes)
            .rest_only("UmBridgeInputSizes")
            .summary("Returns the sizes of a model's vectors of inputs")
            .body(json::<ModelRequest>())
            .example(named.clone())
            .answers(200, "The sizes", json::<InputSizes>())
            .refuses(),
        post(READ, "/umbridge/OutputSizes", (), handlers::output_sizes)
            .rest_only("UmBridgeOutputSizes")
            .summary("Returns the sizes of a model's vectors of outputs")
            .body(json::<ModelRequest>())
            .example(named)
            .answers(200, "The sizes", json::<OutputSizes>())
            .refuses(),
        post(READ_AND_SUBMIT, "/umbridge/Evaluate", (), handlers::evaluate)
            .rest_only("UmBridgeEvaluate")
            .summary("Evaluates a model: submits a job, waits for its end, and returns numbers of its result")
            .body(json::<EvaluateRequest>())
            .example(value!({ "name": "punch", "input": [[0.25, 0.3]], "config": {} }))
            .answers(200, "The outputs", json::<Outputs>())
            .evaluates(),
        post(READ_AND_SUBMIT, "/umbridge/Gradient", (), handlers::gradient)
            .rest_only("UmBridgeGradient")
            .summary("Returns the gradient of an objective by central differences, from two jobs for each number of the input")
            .body(json::<GradientRequest>())
            .example(value!({ "name": "punch", "outWrt": 0, "inWrt": 0, "input": [[0.25, 0.3]], "sens": [1, 0], "config": {} }))
            .answers(200, "The gradient", json::<Derivative>())
            .evaluates(),
        post(READ_AND_SUBMIT, "/umbridge/ApplyJacobian", (), handlers::apply_jacobian)
            .rest_only("UmBridgeApplyJacobian")
            .summary("Returns the derivative of an output along a vector by a central difference, from two jobs")
            .body(json::<JacobianRequest>())
            .example(value!({ "name": "punch", "outWrt": 0, "inWrt": 0, "input": [[0.25, 0.3]], "vec": [1, 0], "config": {} }))
            .answers(200, "The derivative", json::<Derivative>())
            .evaluates(),
        post(READ_AND_SUBMIT, "/umbridge/ApplyHessian", (), handlers::apply_hessian)
            .rest_only("UmBridgeApplyHessian")
            .summary("Is refused: no model has second derivatives")
            .body(json::<ModelRequest>())
            .refuses(),
    ]
}

impl Operation {
    /// May be answered with an error of the client, in the form of the protocol.
    fn refuses(self) -> Self {
        let meaning =
            "`ModelNotFound`, `InvalidInput` or `UnsupportedFeature`, as the protocol has them";
        self.answers(400, meaning, json::<Refused>())
    }

    /// Submits jobs, and may be answered with an error of the model, too.
    fn evaluates(self) -> Self {
        let meaning =
            "`InvalidOutput`, as the protocol has it: a job failed, or its result lacks a number";
        self.refuses()
            .answers(500, meaning, json::<Refused>())
            .fails(&[
                Code::ProblemTooLarge,
                Code::Deleted, // a job, before its result was read
                Code::QuotaExceeded,
                Code::QueueFull,
                Code::Draining,
                Code::StorageFull,
            ])
    }
}
