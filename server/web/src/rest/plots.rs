//! The operations `/v1/jobs/{id}/plots/{plot}.svg`, `.png`, `.pdf`.

use axum::{
    http::{HeaderName, HeaderValue, header},
    response::Response,
};
use base::job::JobId;
use files::plot::{Plot, Size, Stress, Style, Theme};
use service::{
    error::ApiError,
    formats::Format,
    verbs::{
        plots::{self as verbs, Figure, SIZE, STRESS, THEME},
        profiles::STEP,
    },
};

use super::{
    call::Call,
    data::{self, Part, marked},
};

#[expect(
    clippy::too_many_arguments,
    reason = "each is a parameter of the request"
)]
pub(super) async fn plot(
    call: Call,
    id: JobId,
    (plot, format): (Plot, Format),
    theme: Option<Theme>,
    size: Option<Size>,
    stress: Option<Stress>,
    step: Option<String>,
    part: Part,
) -> Result<Response, ApiError> {
    // parameters that have no effect on this figure
    let vain = [
        (stress.is_some() && plot != Plot::Deformed, STRESS.name),
        // fields are those of the last step, and the mesh is that of none
        (
            step.is_some() && matches!(plot, Plot::Deformed | Plot::Mesh),
            STEP.name,
        ),
    ];
    if let Some((_, name)) = vain.into_iter().find(|(vain, _)| *vain) {
        let mut known = vec![THEME.name, SIZE.name];
        match plot {
            Plot::Deformed => known.push(STRESS.name),
            Plot::Profile | Plot::Convergence => known.push(STEP.name),
            Plot::Mesh => {}
        }
        return Err(ApiError::UnknownParameter {
            name: name.into(),
            known: known.join(", "),
        });
    }
    let figure = Figure {
        plot,
        format,
        style: Style {
            theme: theme.unwrap_or_default(),
            size: size.unwrap_or_default(),
            stress: stress.unwrap_or_default(),
        },
        step,
    };
    let found = verbs::plot(&call.service, &call.caller, id, figure).await?;
    let name = format!("{id}.{}", plot.as_str());
    let mut answer = data::whole(&part, format, name, found.content)?;
    let headers = answer.headers_mut();
    // a browser shows it
    if let Some(shown) = headers.get(header::CONTENT_DISPOSITION).and_then(inline) {
        headers.insert(header::CONTENT_DISPOSITION, shown);
    }
    headers.extend(HEADERS);
    Ok(marked(answer, found.available))
}

fn inline(saved: &HeaderValue) -> Option<HeaderValue> {
    let shown = saved.to_str().ok()?.replacen("attachment", "inline", 1);
    HeaderValue::from_str(&shown).ok()
}

/// The headers of an answer with a figure, which may not run scripts or load anything, since its texts come from
/// clients.
const HEADERS: [(HeaderName, HeaderValue); 1] = [(
    header::CONTENT_SECURITY_POLICY,
    HeaderValue::from_static("default-src 'none'; style-src 'unsafe-inline'"),
)];
