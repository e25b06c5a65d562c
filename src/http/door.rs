//! What stands between a connection and the routes: the connection works while a request does, its
//! client is told from proxies' headers, and a connection beyond the limits gets probes alone.

use std::convert::Infallible;
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::http::header::CONNECTION;
use axum::http::{HeaderValue, Request, Response};
use axum::response::IntoResponse;
use hyper::body::{Body as _, Bytes, Frame, Incoming, SizeHint};
use hyper::service::Service;
use hyper_util::service::TowerToHyperService;

use super::client::{Client, behind};
use super::host::PROBES;
use crate::config;
use crate::crowd::{Awaiting, Busy, Member, Network, Peer, Places, Slot};
use crate::error::Error;

/// Of a refused request, so much is taken and dropped, for so long: closing with unread bytes would
/// reset the connection before the answer is read.
const REFUSED_BYTES: usize = 64 * 1024;
const REFUSAL: Duration = Duration::from_secs(1);

/// The routes as connections come to them.
#[derive(Clone)]
pub(super) struct Door {
    routes: TowerToHyperService<Router>,
    proxies: Arc<[Network]>,
    /// Requests that run for one client behind the proxies.
    passed_on: Arc<Places>,
}

/// The connection that a request comes on.
#[derive(Clone)]
pub(super) struct Arrival {
    pub(super) address: IpAddr,
    pub(super) connection: Arc<Member>,
    /// Beyond the limits: probes alone.
    pub(super) probes_alone: bool,
}

impl Door {
    pub(super) fn new(routes: Router, settings: &config::Http) -> Self {
        // Connections bound them in all.
        let name = "http.max_connections_per_address";
        let passed_on = Places::new(usize::MAX, settings.max_connections_per_address, [name, name]);
        let routes = TowerToHyperService::new(routes);
        Self { routes, proxies: settings.trusted_proxies.clone().into(), passed_on }
    }

    /// Whether that address is a proxy, which many clients share.
    pub(super) fn is_proxy(&self, address: IpAddr) -> bool {
        self.proxies.iter().any(|range| range.contains(address))
    }

    /// Answers one request.
    pub(super) async fn enter(
        self,
        arrival: Arrival,
        mut request: Request<Incoming>,
    ) -> Result<Response<Body>, Infallible> {
        let is_probe = PROBES.contains(&request.uri().path());
        // Who is refused makes room for the next, while it is waited for the rest of its request.
        if arrival.probes_alone && !is_probe {
            return Ok(
                refuse(request, "http.max_connections or max_connections_per_address is reached").await
            );
        }
        let busy = arrival.connection.work();
        let mut slot = None;
        let peer = if self.is_proxy(arrival.address) {
            let peer = behind(arrival.address, request.headers(), &self.proxies);
            match self.passed_on.take(peer) {
                Ok(place) => slot = Some(place),
                Err(_) if is_probe => {}
                Err(_) => return Ok(refuse(request, "http.max_connections_per_address is reached").await),
            }
            peer
        } else {
            Peer::from(arrival.address)
        };
        let client = Client { peer, connection: Arc::clone(&arrival.connection) };
        request.extensions_mut().insert(client);
        let connection = Arc::clone(&arrival.connection);
        let request = request.map(|body| Arriving::new(body, arrival.connection));
        let mut response = self.routes.call(request).await?;
        if arrival.probes_alone {
            response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
        }
        Ok(response.map(|body| Body::new(Answering { body, connection, _busy: busy, _slot: slot })))
    }
}

/// 503, after a moment for the rest of the request.
async fn refuse(request: Request<Incoming>, why: &'static str) -> Response<Body> {
    let mut body = request.into_body();
    let rest = async {
        let mut taken = 0;
        while taken < REFUSED_BYTES {
            match std::future::poll_fn(|cx| Pin::new(&mut body).poll_frame(cx)).await {
                Some(Ok(frame)) => taken += frame.data_ref().map_or(0, Bytes::len),
                Some(Err(_)) | None => break,
            }
        }
    };
    // Whether it ended or time did, the answer goes out now.
    let _ended = tokio::time::timeout(REFUSAL, rest).await;
    let mut response = Error::Busy(why).into_response();
    response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    response
}

/// A request's body; while it is waited for, the connection's work waits for its peer.
struct Arriving {
    body: Incoming,
    connection: Arc<Member>,
    awaiting: Option<Awaiting>,
}

impl Arriving {
    fn new(body: Incoming, connection: Arc<Member>) -> Self {
        Self { body, connection, awaiting: None }
    }
}

impl hyper::body::Body for Arriving {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let frame = Pin::new(&mut self.body).poll_frame(cx);
        if frame.is_pending() && self.awaiting.is_none() {
            self.awaiting = Some(self.connection.wait_for_peer());
        }
        if let Poll::Ready(frame) = &frame {
            self.awaiting = None;
            let data = frame.as_ref().and_then(|frame| frame.as_ref().ok()?.data_ref());
            self.connection.moved(data.map_or(0, Bytes::len));
        }
        frame
    }
    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }
    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// An answer's body; while it is sent the connection works, and the request keeps its place.
struct Answering {
    body: Body,
    connection: Arc<Member>,
    _busy: Busy,
    _slot: Option<Slot>,
}

impl hyper::body::Body for Answering {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = Pin::new(&mut self.body).poll_frame(cx);
        if matches!(frame, Poll::Ready(Some(Err(_)))) {
            self.connection.broke();
        }
        frame
    }
    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }
    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
