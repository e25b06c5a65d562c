//! Bounded: input that claims or unpacks to far more than it is, is refused, and costs nothing.

use std::io::Write;
use std::time::Duration;

use flate2::Compression;
use flate2::write::DeflateEncoder;
use reqwest::StatusCode;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::bytes::{self, DEFLATED, EXPLICIT_LE};
use crate::support::client::Client;
use crate::support::service::{Service, Settings};
use crate::support::{memory, pacs, phantom};

const MIB: u64 = 1 << 20;

/// What the process may grow by at most while it refuses a bomb: buffers, not what was claimed.
const FLAT: u64 = 64 * MIB;

const SOP: &str = "2.25.31";
const SERIES: &str = "2.25.32";

fn nested_sequences() -> Vec<u8> {
    let mut data_set = bytes::identity(SOP, SERIES);
    for _ in 0..8_000 {
        data_set.extend(bytes::long_head(0x0040, 0xA730, "SQ", u32::MAX));
        data_set.extend(bytes::item_head(0xE000, u32::MAX));
    }
    for _ in 0..8_000 {
        data_set.extend(bytes::item_head(0xE00D, 0));
        data_set.extend(bytes::item_head(0xE0DD, 0));
    }
    bytes::part10(EXPLICIT_LE, SOP, &data_set)
}

fn claims_4_gb() -> Vec<u8> {
    let mut data_set = bytes::identity(SOP, SERIES);
    data_set.extend(bytes::long_head(0x7FE0, 0x0010, "OW", 0xFFFF_FFFE));
    let mut file = bytes::part10(EXPLICIT_LE, SOP, &data_set);
    file.resize(910, 0);
    file
}

/// Some 2 MB that inflate to 2 GB, twice the default limit.
fn deflate_bomb() -> Vec<u8> {
    let mut data_set = DeflateEncoder::new(Vec::new(), Compression::fast());
    data_set.write_all(&bytes::identity(SOP, SERIES)).unwrap();
    data_set.write_all(&bytes::long_head(0x7FE0, 0x0010, "OW", 0x8000_0000)).unwrap();
    let zeros = vec![0; MIB as usize];
    for _ in 0..2048 {
        data_set.write_all(&zeros).unwrap();
    }
    bytes::part10(DEFLATED, SOP, &data_set.finish().unwrap())
}

fn zip_of(content: &[u8], zeros: u64, entries: usize) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let chunk = vec![0; MIB as usize];
    for entry in 0..entries {
        zip.start_file(format!("{entry}.dcm"), zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
        for _ in 0..zeros / MIB {
            zip.write_all(&chunk).unwrap();
        }
    }
    zip.finish().unwrap().into_inner()
}

/// Holds a step to the promise: the process lives and has not grown.
struct Watched {
    service: Service,
    before: u64,
}

impl Watched {
    fn start(settings: &Settings) -> Self {
        let service = settings.start();
        let before = memory::highest(service.pid());
        Self { service, before }
    }

    fn unharmed(&mut self, after: &str) {
        assert!(self.service.is_alive(), "{after} killed the process");
        let grown = memory::highest(self.service.pid()).saturating_sub(self.before);
        assert!(grown < FLAT, "{after} made the process grow by {} MiB", grown / MIB);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bombs_by_c_store_are_refused_and_cost_nothing() {
    let mut watched = Watched::start(&Settings::new());
    let bombs = [
        ("8 000 nested sequences", nested_sequences()),
        ("910 bytes that claim 4 GB", claims_4_gb()),
        ("a deflate bomb", deflate_bomb()),
    ];
    for (name, bomb) in bombs {
        assert!(bomb.len() < 16 * MIB as usize, "{name} is small");
        let statuses = pacs::statuses(&watched.service, &[bomb]).await;
        assert!(matches!(statuses[..], [0xC001 | 0xA700]), "{name}: {statuses:04X?}");
        watched.unharmed(name);
    }
    assert_nothing_stored(&watched.service).await;
    still_takes_a_series(&watched.service).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bombs_by_upload_are_refused_and_cost_nothing() {
    let settings = Settings::new().with("http.max_unpacked_bytes", "100000000");
    let mut watched = Watched::start(&settings);
    let client = Client::new(watched.service.http);
    let part10_of_zeros = claims_4_gb();
    let bombs = [
        ("8 000 nested sequences", "application/dicom", nested_sequences(), StatusCode::UNPROCESSABLE_ENTITY),
        ("910 bytes that claim 4 GB", "application/dicom", claims_4_gb(), StatusCode::UNPROCESSABLE_ENTITY),
        ("a deflate bomb", "application/dicom", deflate_bomb(), StatusCode::UNPROCESSABLE_ENTITY),
        (
            "a zip bomb",
            "application/zip",
            zip_of(&part10_of_zeros, 1024 * MIB, 1),
            StatusCode::PAYLOAD_TOO_LARGE,
        ),
        ("a zip of 30 000 files", "application/zip", zip_of(b"x", 0, 30_000), StatusCode::PAYLOAD_TOO_LARGE),
    ];
    for (name, media_type, bomb, expected) in bombs {
        assert!(bomb.len() < 16 * MIB as usize, "{name} is small");
        let (status, body) = client.upload(media_type, bomb).await;
        assert_eq!(status, expected, "{name}: {body}");
        assert!(body["type"].as_str().is_some_and(|urn| urn.starts_with("urn:triplanar:problem:")), "{body}");
        watched.unharmed(name);
    }
    assert_nothing_stored(&watched.service).await;
    still_takes_a_series(&watched.service).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pdu_that_claims_4_gib_is_refused_and_costs_nothing() {
    let mut watched = Watched::start(&Settings::new());
    for pdu_type in [0x01, 0x04, 0x07] {
        let mut stream = TcpStream::connect(watched.service.dimse).await.unwrap();
        stream.write_all(&[pdu_type, 0, 0xFF, 0xFF, 0xFF, 0xFF]).await.unwrap();
        // More than any buffer holds; it ends when the service closes the connection.
        let flood = async { while stream.write_all(&[0; 65_536]).await.is_ok() {} };
        let closed = tokio::time::timeout(Duration::from_secs(20), flood).await;
        assert!(closed.is_ok(), "a PDU of type {pdu_type} that claims 4 GiB is read on and on");
        watched.unharmed("a PDU that claims 4 GiB");
    }
    let mut stream = TcpStream::connect(watched.service.dimse).await.unwrap();
    stream.write_all(&[0x01, 0, 0xFF, 0xFF, 0xFF, 0xFF]).await.unwrap();
    let mut answer = Vec::new();
    let read = tokio::time::timeout(Duration::from_secs(20), stream.read_to_end(&mut answer)).await;
    assert!(read.is_ok(), "the connection stays open");
    assert!(matches!(answer.first(), Some(0x03 | 0x07)), "neither A-ASSOCIATE-RJ nor A-ABORT: {answer:?}");
    still_takes_a_series(&watched.service).await;
}

async fn assert_nothing_stored(service: &Service) {
    let page = Client::new(service.http).json("/v1/series").await;
    assert_eq!(page["items"].as_array().map(Vec::len), Some(0), "{page}");
    let incoming = service.data_dir().join("incoming");
    let left: Vec<_> = std::fs::read_dir(&incoming).into_iter().flatten().collect();
    assert!(left.is_empty(), "spool files are left: {left:?}");
}

async fn still_takes_a_series(service: &Service) {
    pacs::push(service, &phantom::small().files[..1]).await;
}
