//! Makes the routes of gRPC: the service, its health, its reflection.

use std::{sync::Arc, time::Duration};

use axum::{Extension, Router, middleware::map_response};
use base::caller::{Caller, Scope};
use futures_util::future::BoxFuture;
use hyper::server::conn::http2;
use hyper_util::{
    rt::{TokioExecutor, TokioIo},
    service::TowerToHyperService,
};
use service::{
    error::ApiError,
    verbs::{MAX_MESSAGE_BYTES, Service},
};
use tokio::{net::UnixStream, sync::mpsc};
use tonic::{Code, Status, server::NamedService, service::Routes};
use tonic_health::server::HealthReporter;

use super::{service::Grpc, workers::Workers};
use crate::pb::{
    self, job_service_server::JobServiceServer, worker::worker_service_server::WorkerServiceServer,
};

/// The largest message between a process and this service (bytes): most results are sent in one.
pub(crate) const MOST_AT_ONCE_HERE: usize = 10 << 20;
/// The bytes between them in one frame, and those that may be under way.
pub(crate) const FRAME_BYTES: u32 = 1 << 20;
pub(crate) const WINDOW_BYTES: u32 = 4 << 20;

/// Makes the gRPC routes, which share a port with REST, and the handle that sets the reported health.
pub fn router(
    service: Arc<Service>,
) -> BoxFuture<'static, Result<(Router, HealthReporter), tonic_reflection::server::Error>> {
    Box::pin(routes(service))
}

async fn routes(
    service: Arc<Service>,
) -> Result<(Router, HealthReporter), tonic_reflection::server::Error> {
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(pb::DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let (reporter, health) = tonic_health::server::health_reporter();
    reporter.set_serving::<JobServiceServer<Grpc>>().await;
    tokio::spawn(report_health(reporter.clone(), service.clone()));
    let workers = WorkerServiceServer::new(Workers::new(service.clone(), false))
        .max_decoding_message_size(MAX_MESSAGE_BYTES);
    let jobs =
        JobServiceServer::new(Grpc::new(service)).max_decoding_message_size(MAX_MESSAGE_BYTES);
    let routes = Routes::new(jobs)
        .add_service(workers)
        .add_service(health)
        .add_service(reflection().build_v1()?)
        .add_service(reflection().build_v1alpha()?);
    let router = routes.into_axum_router();
    Ok((router.layer(map_response(too_large)), reporter))
}

/// Serves the contract for workers to the worker processes of this machine, at each of these sockets until it closes.
pub async fn serve_processes(
    service: Arc<Service>,
    mut sockets: mpsc::UnboundedReceiver<UnixStream>,
) {
    let workers = WorkerServiceServer::new(Workers::new(service, true))
        .max_decoding_message_size(MOST_AT_ONCE_HERE);
    // nobody else has the other end
    let router = Routes::new(workers)
        .into_axum_router()
        .layer(Extension(Caller::new("", [Scope::Work])));
    while let Some(socket) = sockets.recv().await {
        let connection = http2::Builder::new(TokioExecutor::new())
            .max_frame_size(FRAME_BYTES)
            .initial_stream_window_size(WINDOW_BYTES)
            .initial_connection_window_size(WINDOW_BYTES)
            .serve_connection(
                TokioIo::new(socket),
                TowerToHyperService::new(router.clone()),
            );
        // whatever ends it, the process ends then
        tokio::spawn(connection);
    }
}

/// Adds the usual details of errors to the response by which tonic refuses a message over the limit: tonic refuses it
/// without details, before it reaches a method.
async fn too_large(response: axum::response::Response) -> axum::response::Response {
    let bare = Status::from_header_map(response.headers())
        .is_some_and(|status| status.code() == Code::OutOfRange && status.details().is_empty());
    if bare {
        Status::from(ApiError::PayloadTooLarge {
            limit_bytes: MAX_MESSAGE_BYTES,
        })
        .into_http()
    } else {
        response
    }
}

/// Reports whether the service is healthy, until it stops.
async fn report_health(reporter: HealthReporter, service: Arc<Service>) {
    const INTERVAL: Duration = Duration::from_secs(1);
    let mut serving = true;
    loop {
        tokio::select! {
            () = tokio::time::sleep(INTERVAL) => {}
            () = service.queue.stopping().cancelled() => return,
        }
        let works = service.health().await.is_ok();
        if works == serving || service.queue.stopping().is_cancelled() {
            continue;
        }
        serving = works;
        let status = if works {
            tonic_health::ServingStatus::Serving
        } else {
            tonic_health::ServingStatus::NotServing
        };
        for name in ["", JobServiceServer::<Grpc>::NAME] {
            reporter.set_service_status(name, status).await;
        }
    }
}

/// Reports NOT_SERVING, which must happen before the listener closes.
pub async fn report_draining(reporter: &HealthReporter) {
    reporter.set_not_serving::<JobServiceServer<Grpc>>().await;
    reporter
        .set_service_status("", tonic_health::ServingStatus::NotServing)
        .await;
}
