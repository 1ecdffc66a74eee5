//! The operation that draws a figure of a job's problem and result.

use std::{collections::BTreeMap, sync::Arc};

use base::{
    caller::Caller,
    job::{Job, JobId, ResultAvailable},
    values::{Values, Words},
};
use files::plot::{
    self, AxisLimits, Limits, Parts, Plot, Size, Stress, Style, Texts, Theme, image,
};
use futures_util::future::BoxFuture;
use solver::{
    mesh::Mesh,
    problem::Problem,
    solution::{ContactProfile, Fields, Iteration, Summary},
};
use store::Snapshot;

use super::{
    fields,
    fields_in_memory::LoadedFields,
    history::StoredHistory,
    jobs, profiles,
    results::{self, Found, StepResult, read},
    service::Service,
};
use crate::{
    error::ApiError,
    formats::Format,
    parameters::{Parameter, Variable},
};

/// A figure with its format in a path.
pub const PLOT: Variable<Words<(Plot, Format)>> = Variable {
    name: "plot",
    kind: "plot",
    meaning: "The figure and its file format",
    values: Words(|| {
        vec![
            ("mesh.svg", (Plot::Mesh, Format::Svg)),
            ("mesh.png", (Plot::Mesh, Format::Png)),
            ("mesh.pdf", (Plot::Mesh, Format::Pdf)),
            ("deformed.svg", (Plot::Deformed, Format::Svg)),
            ("deformed.png", (Plot::Deformed, Format::Png)),
            ("deformed.pdf", (Plot::Deformed, Format::Pdf)),
            ("profile.svg", (Plot::Profile, Format::Svg)),
            ("profile.png", (Plot::Profile, Format::Png)),
            ("profile.pdf", (Plot::Profile, Format::Pdf)),
            ("convergence.svg", (Plot::Convergence, Format::Svg)),
            ("convergence.png", (Plot::Convergence, Format::Png)),
            ("convergence.pdf", (Plot::Convergence, Format::Pdf)),
        ]
    }),
};

/// The colour theme of a figure.
pub const THEME: Parameter<Words<Theme>> = Parameter {
    name: "theme",
    meaning: "Colour theme; default light",
    values: Words(|| vec![("light", Theme::Light), ("dark", Theme::Dark)]),
};

/// The use of a figure, which determines its size.
pub const SIZE: Parameter<Words<Size>> = Parameter {
    name: "size",
    meaning: "Use of the figure, which sets its size and that of its letters: a column of 88 mm, a page of 160 mm, a slide of 16:9 (254 mm × 142.9 mm); default page",
    values: Words(|| {
        vec![
            ("column", Size::Column),
            ("page", Size::Page),
            ("slide", Size::Slide),
        ]
    }),
};

/// The texts around a figure.
pub const STYLE: Parameter<Words<Texts>> = Parameter {
    name: "style",
    meaning: "Texts around the figure: full has title, parameters, verdict and warnings, bare has none of them; default full",
    values: Words::all(),
};

/// The limits of the horizontal axis.
pub const XLIM: Parameter<TwoNumbers> = Parameter {
    name: "xlim",
    meaning: "Limits of the horizontal axis, such as 0,0.5: of arc length, of iterations, of x or r",
    values: TwoNumbers,
};

/// The limits of the vertical axis.
pub const YLIM: Parameter<TwoNumbers> = Parameter {
    name: "ylim",
    meaning: "Limits of the vertical axis: of the normal stress, of residuals, of y or z",
    values: TwoNumbers,
};

/// The limits of the vertical axis of the lower panels.
pub const YLIM_BELOW: Parameter<TwoNumbers> = Parameter {
    name: "ylim_below",
    meaning: "Limits of the vertical axis of the lower panels, in the figures `profile` (tangential stress) and `convergence` (counts)",
    values: TwoNumbers,
};

/// The limits of an axis as values of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct TwoNumbers;

impl Values for TwoNumbers {
    type Value = Limits;

    fn schema(&self) -> serde_json::Value {
        serde_json::json!({ "type": "string", "pattern": "^[^,]+,[^,]+$" })
    }

    fn expected(&self) -> String {
        Limits::EXPECTED.into()
    }

    fn read(&self, text: &str) -> Option<Limits> {
        text.parse().ok()
    }
}

/// Reads the limits of the axes of a figure from the texts of [`XLIM`], [`YLIM`] and [`YLIM_BELOW`]; the error has the
/// faults of all of them.
pub fn limits(plot: Plot, texts: [Option<&str>; 3]) -> Result<AxisLimits, ApiError> {
    let mut faults = Vec::new();
    let mut read = |parameter: Parameter<TwoNumbers>, text: Option<&str>| {
        let found = text.map(|text| parameter.read(text)).transpose();
        found.unwrap_or_else(|error| {
            faults.push(error.to_string());
            None
        })
    };
    let [x, y, y_below] = texts;
    let limits = AxisLimits {
        x: read(XLIM, x),
        y: read(YLIM, y),
        y_below: read(YLIM_BELOW, y_below),
    };
    let refused = plot.refused(&limits).into_iter();
    faults.extend(refused.map(|(name, reason)| format!("{name}: {reason}")));
    if faults.is_empty() {
        Ok(limits)
    } else {
        Err(ApiError::BadLimits(faults))
    }
}

/// The stress shown on a deformed body.
pub const STRESS: Parameter<Words<Stress>> = Parameter {
    name: "stress",
    meaning: "Stress shown in the figure `deformed` only; default von_mises",
    values: Words(|| {
        vec![
            ("von_mises", Stress::VonMises),
            ("xx", Stress::Xx),
            ("yy", Stress::Yy),
            ("zz", Stress::Zz),
            ("xy", Stress::Xy),
        ]
    }),
};

/// A requested figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The kind of figure.
    pub plot: Plot,
    /// The file format of the figure.
    pub format: Format,
    /// The style of the figure.
    pub style: Style,
    /// The load step at whose end the figure is drawn, by its name or its number from 0; absent: the last one.
    pub step: Option<String>,
    /// Whether the figure of a job without a solution will do.
    pub partial: bool,
}

/// Returns one figure, drawn from the stored data. Only the data that it needs are read.
pub fn plot<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    figure: Figure,
) -> BoxFuture<'a, Result<Found<Vec<u8>>, ApiError>> {
    Box::pin(async move {
        let Figure {
            plot,
            format,
            style,
            step,
            partial,
        } = figure;
        // before there is a permit to work: who has that must not wait for memory
        let fields = match plot {
            Plot::Mesh | Plot::Deformed => fields_of(service, caller, id, plot, partial).await?,
            Plot::Profile | Plot::Convergence => None,
        };
        // the rest once there is a permit, so that waiting requests use no memory for it
        let load = async {
            let mut found = snapshot(service, caller, id, plot).await?;
            if step.is_some() && found.job.result_available == ResultAvailable::None {
                return Err(results::no_result(&found.job));
            }
            let step = match &step {
                None => None,
                Some(wanted) => profiles::find_step(&mut found, wanted, id).await?,
            };
            // the mesh is that of the problem, whatever became of the job
            if plot != Plot::Mesh {
                let step = step.as_ref().map(|step| &step.1);
                results::is_step_wanted(&found.job, step, partial)?;
            }
            let number = step.as_ref().map(|(number, _)| *number);
            let mut columns: Vec<(String, Vec<u8>)> = vec![];
            if matches!(plot, Plot::Profile | Plot::Deformed) {
                for boundary in found.profiled_boundaries().await? {
                    let bytes = profiles::at_all_points(&mut found, &boundary, number).await?;
                    columns.extend(bytes.map(|bytes| (boundary, bytes)));
                }
            }
            let summary = match plot {
                Plot::Mesh => None,
                _ => found.part("summary").await?,
            };
            let history = match plot {
                Plot::Convergence => Some(StoredHistory::load(&mut found, None).await?),
                _ => None,
            };
            let job = found.job.clone();
            drop(found);
            let store = &service.store;
            let stored = store.problem(job.key).await?;
            let (title, problem) = stored.ok_or(ApiError::Deleted(id))?;
            let problem: Problem = Problem {
                title,
                ..read(problem.as_bytes())?
            };
            let stored = match problem.mesh.stored() {
                Some(hash) if plot == Plot::Mesh => {
                    let gone = || {
                        ApiError::NotFound(format!(
                            "the mesh of {id} cannot be drawn: the stored mesh {hash} was deleted; \
                         the plot `deformed` also shows the elements"
                        ))
                    };
                    Some(store.mesh_body(hash).await?.ok_or_else(gone)?)
                }
                _ => None,
            };
            Ok(Loaded {
                job,
                problem,
                step,
                columns,
                summary,
                history,
                fields,
                stored,
            })
        };
        let draw = move |loaded: Loaded| {
            let available = loaded.job.result_available;
            let drawn = loaded.draw(plot, style)?;
            let image = format.image().unwrap_or_default();
            let content = drawn.and_then(|svg| image::write(svg, style.size, image));
            let content = content.map_err(|reason| {
                ApiError::NotFound(format!("{id} has no plot {}: {reason}", plot.as_str()))
            })?;
            Ok(Found::new(available, content))
        };
        service.work_on(load, draw).await?
    })
}

/// Opens a snapshot of the data that a figure is drawn from.
async fn snapshot(
    service: &Service,
    caller: &Caller,
    id: JobId,
    plot: Plot,
) -> Result<Snapshot, ApiError> {
    match plot {
        // these show the problem or the iterations, and so can be drawn while the job waits or runs
        Plot::Mesh | Plot::Convergence => jobs::snapshot(service, caller, id).await,
        Plot::Profile | Plot::Deformed => results::with_result(service, caller, id).await,
    }
}

/// Loads the fields of a job for a figure, once there is memory for them.
async fn fields_of(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
    plot: Plot,
    partial: bool,
) -> Result<Option<Arc<LoadedFields>>, ApiError> {
    let found = snapshot(service, caller, id, plot).await?;
    let job = found.job.clone();
    drop(found);
    if plot == Plot::Deformed {
        results::is_wanted(&job, partial)?;
        fields::are_kept(service, &job).await?;
    }
    let fields = fields::load(service, job.key).await?;
    if plot == Plot::Deformed && fields.is_none() {
        Err(results::no_result(&job))
    } else {
        Ok(fields)
    }
}

/// The data that figures are drawn from, mostly in their stored form; parts that a figure does not need are absent.
struct Loaded {
    job: Job,
    problem: Problem,
    /// The requested load step, with its number from 0.
    step: Option<(usize, StepResult)>,
    columns: Vec<(String, Vec<u8>)>,
    summary: Option<Vec<u8>>,
    history: Option<StoredHistory>,
    fields: Option<Arc<LoadedFields>>,
    stored: Option<Vec<u8>>,
}

impl Loaded {
    /// Draws the figure as SVG; the inner `Err` is the reason why this job has no such figure.
    fn draw(self, plot: Plot, style: Style) -> Result<Result<String, String>, ApiError> {
        let summary: Option<Summary> = self.summary.map(|bytes| read(&bytes)).transpose()?;
        let mut profiles: BTreeMap<String, ContactProfile> = BTreeMap::new();
        for (boundary, bytes) in self.columns {
            profiles.insert(boundary, read(&bytes)?);
        }
        let history = self.history.map_or(Ok(vec![]), StoredHistory::read)?;
        let mut history: Vec<Iteration> = history.into_iter().map(|row| row.timed.row).collect();
        if let Some((number, _)) = &self.step {
            history.retain(|row| row.step as usize == *number);
        }
        if plot == Plot::Convergence && history.is_empty() {
            return Err(results::no_result(&self.job));
        }
        let nothing = Fields::default();
        let fields = self.fields.as_ref().map_or(&nothing, |found| &found.fields);
        let stored: Option<Mesh> = self
            .stored
            .map(|bytes| postcard::from_bytes(&bytes).map_err(ApiError::internal))
            .transpose()?;
        let parts = Parts {
            history: &history,
            summary: match &self.step {
                Some((_, step)) => Some(&step.summary),
                None => summary.as_ref(),
            },
            // a load step that converged is a solution, whatever becomes of the job
            partial: match &self.step {
                Some((_, step)) => !step.summary.converged,
                None => self.job.result_available != ResultAvailable::Final,
            },
            step: self.step.as_ref().map(|(_, step)| step.name.as_str()),
            profiles: &profiles,
            fields,
            stored: stored.as_ref(),
        };
        Ok(plot::draw(plot, style, &self.problem, &parts))
    }
}
