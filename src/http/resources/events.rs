//! Server-sent events: what happens to a reconstruction, until it has ended.

use std::convert::Infallible;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::response::sse::{Event as Message, KeepAlive, Sse};
use futures_util::Stream;
use futures_util::stream;
use tokio::sync::broadcast::{self, error::RecvError};

use super::reconstruction_record;
use crate::crowd::{Apart, LimitReached, Slot};
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::client::Client;
use crate::http::extract::ReconstructionPath;
use crate::http::views::ReconstructionView;
use crate::jobs::Event;
use crate::store::{ReconstructionId, ReconstructionRecord};

/// A comment is sent after so long without an event, so that proxies keep the connection.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

/// Where a stream stands.
enum Step {
    /// Tell this state, then go on.
    Tell(Box<ReconstructionRecord>),
    /// Wait for the next change.
    Wait,
    /// The result was told.
    End,
}

/// The stream of one client.
struct Watching {
    context: Context,
    id: ReconstructionId,
    events: broadcast::Receiver<Event>,
    step: Step,
    _slot: Slot,
    _apart: Apart,
}

/// One event of the stream.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "for the API's description alone")]
pub(in crate::http) struct EventMessage {
    /// `progress` or `result`.
    #[schema(pattern = "^(progress|result)$")]
    event: String,
    /// JSON: of `progress` with `id`, `state`, `stage`, `fraction`; of `result` the reconstruction.
    data: String,
}

/// Watch a reconstruction
///
/// Server-sent events. `progress` (data: `id`, `state`, `stage`, `fraction`) at once and with every
/// change of state or stage; at the end `result` (data: the reconstruction), and the stream ends.
#[utoipa::path(
    get,
    path = "/v1/reconstructions/{id}/events",
    operation_id = "watchReconstruction",
    tag = "Reconstructions",
    params(("id" = uuid::Uuid, Path, description = "The reconstruction's id.")),
    responses(
        (status = 200, description = "The events.", body = EventMessage, content_type = "text/event-stream"),
        (status = 404, description = "No such reconstruction."),
    ),
)]
pub(in crate::http) async fn reconstruction_events(
    State(context): State<Context>,
    ReconstructionPath(id): ReconstructionPath,
    Extension(client): Extension<Client>,
) -> Result<Sse<impl Stream<Item = Result<Message, Infallible>>>> {
    // First subscribe, then read: so no change falls in between.
    let events = context.jobs.subscribe(id);
    let record = reconstruction_record(&context, id).await?;
    let slot = context.streams.take(client.peer).map_err(|LimitReached(limit)| Error::Busy(limit))?;
    // The stream has a limit of its own; it takes no place of other requests.
    let apart = client.connection.stand_apart();
    let watching =
        Watching { context, id, events, step: Step::Tell(Box::new(record)), _slot: slot, _apart: apart };
    let messages = stream::unfold(watching, |mut watching| async move {
        let message = watching.next().await?;
        Some((Ok(message), watching))
    });
    Ok(Sse::new(messages).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)))
}

impl Watching {
    /// The next message; `None` after the result, at shutdown, or when the reconstruction is gone.
    async fn next(&mut self) -> Option<Message> {
        match std::mem::replace(&mut self.step, Step::Wait) {
            Step::End => None,
            Step::Tell(record) if record.state.is_final() => Some(self.result(*record)),
            Step::Tell(record) => Some(progress(&Event {
                id: record.id,
                state: record.state,
                stage: record.stage,
                fraction: record.fraction,
            })),
            Step::Wait => self.change().await,
        }
    }

    async fn change(&mut self) -> Option<Message> {
        let shutdown = self.context.shutdown.clone();
        let received = tokio::select! {
            received = self.events.recv() => received,
            () = shutdown.cancelled() => return None,
        };
        match received {
            Ok(event) if !event.state.is_final() => Some(progress(&event)),
            // The end, or events that we were too slow for: the catalog has the truth.
            Ok(_) | Err(RecvError::Lagged(_) | RecvError::Closed) => {
                let record = self.context.store.reconstruction(self.id).await.ok()??;
                if record.state.is_final() {
                    return Some(self.result(record));
                }
                if matches!(received, Err(RecvError::Closed)) {
                    self.events = self.context.jobs.subscribe(self.id);
                }
                Some(progress(&Event {
                    id: record.id,
                    state: record.state,
                    stage: record.stage,
                    fraction: record.fraction,
                }))
            }
        }
    }

    fn result(&mut self, record: ReconstructionRecord) -> Message {
        self.step = Step::End;
        message("result", &ReconstructionView::from(record))
    }
}

fn progress(event: &Event) -> Message {
    message("progress", event)
}

fn message(name: &str, data: &impl serde::Serialize) -> Message {
    // Serialising fails for maps with odd keys alone, which these have not.
    Message::default().event(name).json_data(data).unwrap_or_else(|_| Message::default().event("error"))
}
