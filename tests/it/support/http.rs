//! The HTTP server in this process, on a data directory and a port of its own.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::Value;
use tokio::io::AsyncWriteExt as _;
use tokio::net::{TcpListener, TcpStream};
use tokio_util::sync::CancellationToken;
use triplanar::cloud::{Format, Metadata, PointCloud, encode};
use triplanar::config::Config;
use triplanar::dicom::series::{ReadLimits, read};
use triplanar::dicom::uid::SeriesInstanceUid;
use triplanar::geometry::{Frame, Plane, PlaneSet};
use triplanar::http::{self, AppState};
use triplanar::intake::Intake;
use triplanar::jobs::Jobs;
use triplanar::observer::Silent;
use triplanar::pipeline::{Figures, Reason, Rejection, SliceRow};
use triplanar::reconstruction::Report;
use triplanar::store::{Outcome, ReconstructionId, Store};
use triplanar::telemetry::Metrics;

use super::entrance::settings;
use super::slice::Slice;

/// Slices of a series of these tests.
pub(crate) const SLICES: u32 = 10;

/// A running server; dropped, it stops.
pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    pub(crate) store: Store,
    pub(crate) intake: Intake,
    pub(crate) shutdown: CancellationToken,
    pub(crate) served: tokio::task::JoinHandle<()>,
    pub(crate) config: Arc<Config>,
    client: reqwest::Client,
    jobs: Jobs,
    _dir: tempfile::TempDir,
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shutdown.cancel();
    }
}

impl Server {
    pub(crate) async fn start() -> Self {
        Self::with(|_| {}).await
    }

    /// With other settings than [`settings`].
    pub(crate) async fn with(change: impl FnOnce(&mut Config)) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut config = settings(dir.path());
        change(&mut config);
        let config = Arc::new(config);
        let store = Store::open(&config.storage).await.expect("the data directory opens");
        let metrics = Arc::new(Metrics::new());
        let jobs = Jobs::new(store.clone(), &config, Arc::clone(&metrics)).expect("threads");
        let intake = Intake::new(store.clone(), &config, Arc::clone(&metrics), jobs.wakeup(), jobs.memory());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let shutdown = CancellationToken::new();
        let state = AppState {
            store: store.clone(),
            intake: intake.clone(),
            jobs: jobs.clone(),
            config: Arc::clone(&config),
            metrics,
        };
        let stop = shutdown.clone();
        let served =
            tokio::spawn(async move { http::serve(listener, state, stop).await.expect("it serves") });
        let client = reqwest::Client::builder().no_proxy().build().unwrap();
        Self { address, store, intake, shutdown, served, config, client, jobs, _dir: dir }
    }

    /// Runs the workers too, until the server is dropped.
    pub(crate) fn work(&self) {
        let (jobs, stop) = (self.jobs.clone(), self.shutdown.clone());
        tokio::spawn(async move { jobs.run(stop).await });
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, self.url(path))
    }

    pub(crate) fn get(&self, path: &str) -> RequestBuilder {
        self.request(Method::GET, path)
    }

    pub(crate) fn post(&self, path: &str) -> RequestBuilder {
        self.request(Method::POST, path)
    }

    /// Uploads one file and expects 202.
    pub(crate) async fn upload(&self, query: &str, body: Vec<u8>) -> Value {
        let response = self.post(&format!("/v1/series{query}")).body(body).send().await.unwrap();
        let status = response.status();
        let told = response.text().await.unwrap();
        assert_eq!(status, StatusCode::ACCEPTED, "{told}");
        serde_json::from_str(&told).unwrap()
    }

    /// An upload whose body does not come, and the refusal of one beside it.
    pub(crate) async fn filled_by_an_upload(&self) -> (TcpStream, Response) {
        let mut slow = TcpStream::connect(self.address).await.unwrap();
        let head = b"POST /v1/series HTTP/1.1\r\nhost: localhost\r\ncontent-length: 10000\r\n\r\nPK";
        slow.write_all(head).await.unwrap();
        // Until the first one has been let in, a second one may be; an upload of nothing is refused.
        loop {
            let beside = self.post("/v1/series").body("x").send().await.unwrap();
            if beside.status() == StatusCode::SERVICE_UNAVAILABLE {
                return (slow, beside);
            }
        }
    }

    /// Returns when an upload is let in.
    pub(crate) async fn room_for_an_upload(&self) {
        let refused = async || self.post("/v1/series").body("x").send().await.unwrap().status();
        while refused().await == StatusCode::SERVICE_UNAVAILABLE {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// A complete series of [`SLICES`] slices whose reconstruction waits.
    pub(crate) async fn queued(&self, series: u32) -> (SeriesInstanceUid, ReconstructionId) {
        let told = self.upload("", zip_of(series, SLICES)).await;
        let id =
            told["series"][0]["reconstruction"]["id"].as_str().expect("a reconstruction").parse().unwrap();
        (Slice::of(series, 0).series_uid(), id)
    }

    /// The same, with a result of the test's making: [`cloud`] and a report of the real slices.
    pub(crate) async fn succeeded(&self, series: u32) -> (SeriesInstanceUid, ReconstructionId) {
        let (uid, id) = self.queued(series).await;
        self.finish(&uid).await;
        (uid, id)
    }

    /// Gives the waiting reconstruction of `uid` its result.
    pub(crate) async fn finish(&self, uid: &SeriesInstanceUid) {
        let claim = self.store.claim("test", Duration::from_secs(60)).await.unwrap().expect("one waits");
        let instances = self.store.instances_of(&claim.reconstruction).await.unwrap();
        let source = self.store.instance_source(&instances);
        let limits = ReadLimits::default();
        let volume = tokio::task::spawn_blocking(move || read(&source, &limits, &Silent)).await.unwrap();
        let (volume, _) = volume.expect("a volume");
        let parameters = &claim.reconstruction.parameters;
        let report = Report::new(&volume, parameters, &Figures::default(), &rows());
        let planes = [None, Some(Plane::Axial), Some(Plane::Sagittal), Some(Plane::Coronal)];
        let clouds = planes.map(|plane| {
            let cloud = if plane.is_none() { cloud() } else { PointCloud::default() };
            (plane, encode(&cloud, &metadata(uid, plane), Format::PlyBinary, Frame::Lps))
        });
        let outcome = Outcome {
            clouds: clouds.into(),
            report: report.to_json(),
            figures: Figures::default(),
            quality: None,
            pictures: None,
        };
        assert!(self.store.finish_success(&claim.lease, &outcome).await.unwrap());
    }
}

/// The cloud of every succeeded reconstruction of these tests.
pub(crate) fn cloud() -> PointCloud {
    let points: Vec<_> = (0..500_u16).map(|i| [f32::from(i), 2.5, -f32::from(i) / 4.0]).collect();
    PointCloud {
        planes: vec![PlaneSet::from(Plane::Axial); points.len()],
        unique: vec![false; points.len()],
        points,
        ..PointCloud::default()
    }
}

pub(crate) fn metadata(uid: &SeriesInstanceUid, plane: Option<Plane>) -> Metadata {
    Metadata {
        series_instance_uid: uid.clone(),
        frame_of_reference_uid: Some("1.2.3".parse().unwrap()),
        plane,
        max_error_mm: None,
        software: "test".to_owned(),
        parameters_json: "{}".to_owned(),
    }
}

/// One accepted and otherwise rejected slices: 10 axial, 8 sagittal, 8 coronal.
fn rows() -> Vec<SliceRow> {
    let row = |plane, index| SliceRow {
        plane,
        index,
        rejection: (index != 0).then_some(Rejection { reason: Reason::Solidity, measured: 0.5, limit: 0.88 }),
        contour_area: Some(100.0),
        solidity: Some(0.5),
        contour_points: 12,
        carried_area: (None, None),
        accepted_mm: None,
        stretches: Vec::new(),
    };
    let axial = (0..SLICES as usize).map(|index| row(Plane::Axial, index));
    let sagittal = (0..8).map(|index| row(Plane::Sagittal, index));
    axial.chain(sagittal).chain((0..8).map(|index| row(Plane::Coronal, index))).collect()
}

/// Slices `0..slices` of a series, numbered so that no two series share an instance.
pub(crate) fn slices(series: u32, slices: u32) -> Vec<Slice> {
    (0..slices).map(|number| Slice::of(series, series * 100 + number)).collect()
}

/// A zip of files.
pub(crate) fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    use std::io::Write;
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for (name, bytes) in files {
        if name.ends_with('/') {
            archive.add_directory(*name, options).unwrap();
        } else {
            archive.start_file(*name, options).unwrap();
            archive.write_all(bytes).unwrap();
        }
    }
    archive.finish().unwrap().into_inner()
}

/// A zip of a whole series.
pub(crate) fn zip_of(series: u32, count: u32) -> Vec<u8> {
    let files: Vec<_> = slices(series, count)
        .iter()
        .map(|slice| (format!("CT/{}.dcm", slice.number), slice.part10()))
        .collect();
    let files: Vec<_> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    zipped(&files)
}

/// Expects a problem of that status and code, and gives its body.
pub(crate) async fn problem(response: Response, status: u16, code: &str) -> Value {
    let got = response.status().as_u16();
    let media_type = response.headers().get("content-type").map(|v| v.to_str().unwrap().to_owned());
    let request_id = response.headers().get("x-request-id").map(|v| v.to_str().unwrap().to_owned());
    let text = response.text().await.unwrap();
    assert_eq!(got, status, "{text}");
    assert_eq!(media_type.as_deref(), Some("application/problem+json"), "{text}");
    let body: Value = serde_json::from_str(&text).expect("a problem is JSON");
    assert_eq!(body["type"], format!("urn:triplanar:problem:{code}"), "{text}");
    assert_eq!(body["status"], status);
    assert!(body["title"].is_string() && body["detail"].is_string(), "{text}");
    let request_id = request_id.expect("every answer has a request id");
    assert_eq!(body["instance"], format!("urn:uuid:{request_id}"));
    body
}
