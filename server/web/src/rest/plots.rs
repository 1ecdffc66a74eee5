//! The operations `/v1/jobs/{id}/plots/{plot}.svg`, `.png`, `.pdf`.

use axum::{
    http::{HeaderName, HeaderValue, header},
    response::Response,
};
use base::job::JobId;
use files::plot::{Plot, Size, Stress, Style, Texts, Theme};
use service::{
    error::ApiError,
    formats::Format,
    parameters::Description,
    verbs::{
        jobs,
        plots::{self as verbs, Figure, SIZE, STRESS, STYLE, THEME, XLIM, YLIM, YLIM_BELOW},
        profiles::STEP,
        results::PARTIAL,
        views,
    },
};

use super::{
    call::Call,
    data::{self, Part, marked},
    input::{Input, RawInput},
};

/// The input of how a figure looks; limits of axes are read with the figure, all of them at once.
pub(super) const LOOK: Look = Look;

/// An input that reads theme, size, style and stress, and takes the texts of limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look;

/// How a figure is to look.
pub(super) struct Looks {
    theme: Option<Theme>,
    size: Option<Size>,
    texts: Option<Texts>,
    stress: Option<Stress>,
    /// The texts of the limits of axes.
    limits: [Option<String>; 3],
}

impl Input for Look {
    type Value = Looks;

    fn descriptions(&self) -> Vec<Description> {
        let limits = [XLIM, YLIM, YLIM_BELOW].map(|limits| limits.describe());
        let others = (THEME, SIZE, STYLE, STRESS).descriptions();
        [others, limits.to_vec()].concat()
    }

    fn extract(&self, raw: &RawInput<'_>) -> Result<Looks, ApiError> {
        let limits = [XLIM, YLIM, YLIM_BELOW];
        let (theme, size, texts, stress) = (THEME, SIZE, STYLE, STRESS).extract(raw)?;
        Ok(Looks {
            theme,
            size,
            texts,
            stress,
            limits: limits.map(|limits| raw.one(limits.name).map(str::to_owned)),
        })
    }
}

pub(super) async fn plot(
    call: Call,
    id: JobId,
    (plot, format): (Plot, Format),
    look: Looks,
    step: Option<String>,
    partial: Option<bool>,
    part: Part,
) -> Result<Response, ApiError> {
    let stress = look.stress;
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
        let mut known = vec![
            THEME.name,
            SIZE.name,
            STYLE.name,
            XLIM.name,
            YLIM.name,
            PARTIAL.name,
        ];
        match plot {
            Plot::Deformed => known.push(STRESS.name),
            Plot::Profile | Plot::Convergence => known.extend([YLIM_BELOW.name, STEP.name]),
            Plot::Mesh => {}
        }
        return Err(ApiError::UnknownParameter {
            name: name.into(),
            known: known.join(", "),
        });
    }
    let job = jobs::get(&call.service, &call.caller, id).await?;
    let what = format!(
        "{plot:?} {format:?} {:?} {:?} {:?} {:?} {:?} {step:?} {partial:?}",
        look.theme, look.size, look.texts, look.stress, look.limits
    );
    let tag = views::tag_of(&job, &what);
    if let Some(known) = part.known(tag.as_deref()) {
        return Ok(marked(known, job.result_available));
    }
    let figure = Figure {
        plot,
        format,
        style: Style {
            theme: look.theme.unwrap_or_default(),
            size: look.size.unwrap_or_default(),
            texts: look.texts.unwrap_or_default(),
            limits: verbs::limits(plot, look.limits.each_ref().map(Option::as_deref))?,
            stress: stress.unwrap_or_default(),
        },
        step,
        partial: partial.unwrap_or_default(),
    };
    let found = verbs::plot(&call.service, &call.caller, id, figure).await?;
    let name = format!("{id}.{}", plot.as_str());
    let mut answer = data::tagged(&part, format, name, found.content, tag)?;
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
