//! Bounded: input that claims or unpacks to far more than it is, is refused, and costs nothing.

use std::io::Write;
use std::time::Duration;

use flate2::{Compress, Compression, FlushCompress};
use reqwest::StatusCode;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::bytes::{self, DEFLATED, EXPLICIT_LE};
use crate::support::client::Client;
use crate::support::scu::{CT, Request, Scu};
use crate::support::service::{Service, Settings};
use crate::support::{memory, pacs, phantom};

const MIB: usize = 1 << 20;

/// What the process may grow by at most while it refuses a bomb: buffers, not what was claimed.
const FLAT_MIB: u64 = 64;

const SOP: &str = "2.25.31";
const SERIES: &str = "2.25.32";

/// A data set that is not what it seems.
struct Bomb {
    name: &'static str,
    transfer_syntax: &'static str,
    data_set: Vec<u8>,
    /// DIMSE and HTTP status that it is refused with.
    refusal: (u16, StatusCode),
}

impl Bomb {
    fn part10(&self) -> Vec<u8> {
        bytes::part10(self.transfer_syntax, SOP, &self.data_set)
    }
}

fn bombs() -> [Bomb; 3] {
    let malformed = (0xC001, StatusCode::UNPROCESSABLE_ENTITY);
    [
        Bomb {
            name: "8 000 nested sequences",
            transfer_syntax: EXPLICIT_LE,
            data_set: nested_sequences(),
            refusal: malformed,
        },
        Bomb {
            name: "910 bytes that claim 4 GB",
            transfer_syntax: EXPLICIT_LE,
            data_set: claims_4_gb(),
            refusal: malformed,
        },
        Bomb {
            name: "a deflate bomb",
            transfer_syntax: DEFLATED,
            data_set: deflate_bomb(),
            refusal: (0xA700, StatusCode::PAYLOAD_TOO_LARGE),
        },
    ]
}

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
    data_set
}

/// Such that the file is 910 bytes long.
fn claims_4_gb() -> Vec<u8> {
    let mut data_set = bytes::identity(SOP, SERIES);
    data_set.extend(bytes::long_head(0x7FE0, 0x0010, "OW", 0xFFFF_FFFE));
    let header = bytes::part10(EXPLICIT_LE, SOP, &[]).len();
    data_set.resize(910 - header, 0);
    data_set
}

/// Some 2 MB that inflate to 2 GB, twice the default limit.
fn deflate_bomb() -> Vec<u8> {
    let mut head = bytes::identity(SOP, SERIES);
    head.extend(bytes::long_head(0x7FE0, 0x0010, "OW", 0x8000_0000));
    // A flushed block ends on a byte and looks back at nothing before it: it can be repeated.
    let zeros = deflated(&vec![0; MIB]);
    let last_block_and_empty = [0x03, 0x00];
    [deflated(&head), zeros.repeat(2048), last_block_and_empty.to_vec()].concat()
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() + 1024);
    Compress::new(Compression::best(), false)
        .compress_vec(bytes, &mut out, FlushCompress::Sync)
        .expect("it fits");
    out
}

fn zip_of(content: &[u8], zeros: usize, entries: usize) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let chunk = vec![0; MIB];
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
        let grown = memory::highest(self.service.pid()).saturating_sub(self.before) / MIB as u64;
        assert!(grown < FLAT_MIB, "{after} made the process grow by {grown} MiB");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bombs_by_c_store_are_refused_and_cost_nothing() {
    let mut watched = Watched::start(&Settings::new());
    for bomb in bombs() {
        assert!(bomb.data_set.len() < 8 * MIB, "{} is small", bomb.name);
        let request = Request::new(&[(1, CT, &[bomb.transfer_syntax])]);
        let mut scu = Scu::associate(watched.service.dimse, &request);
        scu.store(1, 1, SOP, &bomb.data_set, 100_000);
        let response = scu.response();
        assert_eq!(response.status(), bomb.refusal.0, "{}: {}", bomb.name, response.comment());
        scu.release();
        watched.unharmed(bomb.name);
    }
    assert_nothing_stored(&watched.service).await;
    still_takes_a_series(&watched.service).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bombs_by_upload_are_refused_and_cost_nothing() {
    let settings = Settings::new().with("http.max_unpacked_bytes", "100000000");
    let mut watched = Watched::start(&settings);
    let client = Client::new(watched.service.http);
    let mut uploads: Vec<_> = bombs()
        .into_iter()
        .map(|bomb| (bomb.name, "application/dicom", bomb.part10(), bomb.refusal.1))
        .collect();
    let zeros_as_dicom = bytes::part10(EXPLICIT_LE, SOP, &claims_4_gb());
    let zips = [
        ("a zip bomb", zip_of(&zeros_as_dicom, 1024 * MIB, 1)),
        ("a zip bomb of zeros", zip_of(&[], 1024 * MIB, 1)),
        ("a zip of 30 000 files", zip_of(b"x", 0, 30_000)),
    ];
    for (name, zip) in zips {
        uploads.push((name, "application/zip", zip, StatusCode::PAYLOAD_TOO_LARGE));
    }
    for (name, media_type, body, expected) in uploads {
        assert!(body.len() < 8 * MIB, "{name} is small");
        let (status, answer) = client.upload(media_type, body).await;
        assert_eq!(status, expected, "{name}: {answer}");
        assert!(
            answer["type"].as_str().is_some_and(|urn| urn.starts_with("urn:triplanar:problem:")),
            "{answer}"
        );
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
