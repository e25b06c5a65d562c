//! What can be refused, and its one mapping: each variant becomes one DIMSE status (PS3.7 annex C,
//! PS3.4 table B.2-1) and one problem detail (RFC 9457) with a stable URN.
//!
//! Messages tell the reader what to do next and never carry a patient's identity. What went wrong
//! inside ([`Error::Internal`]) is logged and not sent.

use crate::dicom::scan::ScanError;
use crate::dicom::uid::{SeriesInstanceUid, SopClassUid, SopInstanceUid, TransferSyntaxUid};

/// The result of an operation of the service.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that a peer can be refused for.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    // ---- an instance ----
    /// The bytes are no DICOM data set. C000, 400.
    #[error("not a DICOM data set: {0}; send a Part 10 file or a data set in the negotiated transfer syntax")]
    NotDicom(String),
    /// The bounded scan refused the structure: depth, length, item count. C001, 422.
    #[error("the data set's structure is not acceptable: {0}")]
    MalformedDataSet(String),
    /// An attribute that every instance must have is missing or unusable. C002, 422.
    #[error("attribute {attribute} is missing or not valid; the sender must supply it")]
    MissingAttribute {
        /// Name and tag, as `SeriesInstanceUID (0020,000E)`.
        attribute: &'static str,
    },
    /// The pixel data is shorter or longer than the matrix and the frames need. C007, 422.
    #[error("{0}; the sender must send the whole image again")]
    PixelDataSize(#[from] crate::dicom::PixelExtentError),
    /// The instance is stored already with other pixels or geometry. C003, 409.
    #[error("SOP instance {0} is already stored with different pixels or geometry; the stored one was kept")]
    ConflictingInstance(SopInstanceUid),
    /// The instance is stored already in another transfer syntax, and the pixels of one of them can't be
    /// decoded. C009, 409.
    #[error(
        "SOP instance {0} is already stored in another transfer syntax, and pixels that can't be decoded here can't be \
         compared; the stored one was kept: send it in the transfer syntax in which it came first, or give it a UID of \
         its own"
    )]
    IncomparableInstance(SopInstanceUid),
    /// The instance is stored already, and the budget of memory is too small to compare the two. C009, 409.
    #[error(
        "SOP instance {0} is already stored with other bytes, and the two can't be compared: {1}; the stored one was \
         kept: raise the budget, or send what came first"
    )]
    TooLargeToCompare(SopInstanceUid, crate::memory::NoMemory),
    /// The instance is stored already in another series or study. C004, 409.
    #[error("SOP instance {0} is already stored as part of another series or study; the stored one was kept")]
    ConflictingSeries(SopInstanceUid),
    /// The series is stored already as part of another study. C006, 409.
    #[error("series {0} is already stored as part of another study; the stored one was kept")]
    ConflictingStudy(SeriesInstanceUid),
    /// The instance is stored already with another identity, and `intake.changed_identity` is "refuse".
    /// C008, 409.
    #[error(
        "SOP instance {0} is already stored with another identity (patient or accession number), and corrections are \
         refused here (intake.changed_identity); the stored one was kept"
    )]
    ConflictingIdentity(SopInstanceUid),
    /// The series holds as many instances as it may. A700, 413.
    #[error("the series holds as many instances as it may: {limit} ({setting})")]
    SeriesFull {
        /// The limit.
        limit: u64,
        /// The setting to raise.
        setting: &'static str,
    },
    /// The transfer syntax of the data set can't be decoded here. C005, 415.
    #[error("transfer syntax {0} can't be decoded here; send one that the conformance statement lists")]
    UnsupportedTransferSyntax(TransferSyntaxUid),
    /// The SOP class is not a CT image. 0122, 422.
    #[error(
        "SOP class {0} is not accepted: CT Image, Enhanced CT Image and Legacy Converted Enhanced CT Image are"
    )]
    UnsupportedSopClass(SopClassUid),
    /// Command and data set disagree about SOP class or instance. A900, 422.
    #[error("the data set does not match what was announced: {0}")]
    DataSetMismatch(String),
    /// One instance is larger than configured. A700, 413.
    #[error("larger than the limit of {limit_bytes} bytes ({setting})")]
    TooLarge {
        /// The limit.
        limit_bytes: u64,
        /// The setting to raise, as `intake.max_instance_bytes`.
        setting: &'static str,
    },
    /// The disk is (nearly) full. A700, 507.
    #[error(
        "the free disk space is below the configured watermark (storage.min_free_bytes); free some or add some"
    )]
    OutOfStorage,
    /// No file can be opened any more; passes when others are closed. A700, 503.
    #[error("too many files are open; raise the limit of open files (ulimit -n) if it comes again")]
    OutOfDescriptors,
    /// The system gives no memory. A700, 503.
    #[error("the system gives no more memory; try again later")]
    OutOfMemory,
    /// The service's user may not read or write in the data directory, or its disk is read-only; passes
    /// when the operator gives the rights. A700, 503.
    #[error(
        "the service may not read or write in its data directory; give its user the rights to all of \
         storage.data_dir (/readyz and the log tell where)"
    )]
    NotPermitted,
    /// The catalog is found damaged: nothing is taken that could be lost with it. A700, 503.
    #[error(
        "the catalog is damaged, and nothing is stored before it is mended; the operator must stop the service \
         (`triplanar check` says more), bring the catalog back from a backup or make a new one with `triplanar rebuild`"
    )]
    CatalogDamaged,
    /// Stored bytes are missing or are not what was received. 0110, 500.
    #[error("{0}")]
    StoredDamaged(String),
    /// A queue, connection or rate limit is reached; the same request may go through later. A700, 503.
    #[error("busy: {0}; try again later")]
    Busy(&'static str),
    /// The service is shutting down. A700, 503.
    #[error("the service is shutting down; try again later")]
    ShuttingDown,

    // ---- an upload ----
    /// The archive or multipart body can't be read. 400.
    #[error("the upload can't be read: {0}")]
    MalformedUpload(String),
    /// The archive unpacks to too much, or holds too many files. 413.
    #[error("the archive unpacks beyond a limit: {0}")]
    ArchiveTooLarge(String),
    /// The upload holds no DICOM instance. 422.
    #[error("the upload holds no DICOM instance")]
    EmptyUpload,

    // ---- a request ----
    /// No or no valid token. 401.
    #[error("a valid bearer token is needed: Authorization: Bearer <token>")]
    Unauthorized,
    /// The token's role does not allow this. 403.
    #[error("this token's role does not allow that; it needs the role {0}")]
    Forbidden(&'static str),
    /// `Host` is missing, double or not valid. 400.
    #[error("the request does not say whom it is for: {0}; send one Host header, as Host: localhost:8080")]
    InvalidHost(&'static str),
    /// The host that is asked for is none of ours. 421. (The name is not repeated.)
    #[error(
        "the service does not answer to that host name: use localhost or a loopback address, or list the name \
         under [http] hosts"
    )]
    MisdirectedRequest,
    /// A page of another origin wants to change something. 403.
    #[error(
        "a page of another origin may not change anything here; behind a proxy, pass the Host header on and \
         list the name under [http] hosts"
    )]
    ForeignOrigin,
    /// Nothing with that id. 404.
    #[error("no {what} with the id {id}")]
    NotFound {
        /// `series`, `reconstruction`, `slice`, …
        what: &'static str,
        /// The id asked for.
        id: String,
    },
    /// Nothing is at the path. 404. (The path is not repeated: it may hold anything.)
    #[error("nothing is at this path; /openapi.json lists what there is")]
    NoSuchPath,
    /// A parameter of the request is not valid. 400.
    #[error("{name}: {detail}")]
    InvalidParameter {
        /// The parameter's name.
        name: String,
        /// What is wrong and what would be right.
        detail: String,
    },
    /// The request's body is not valid. 422.
    #[error("the request's body is not valid: {0}")]
    InvalidBody(String),
    /// The body's media type is not one that this resource takes. 415.
    #[error("{0}")]
    UnsupportedMediaType(String),
    /// None of the media types that the client accepts. 406.
    #[error("none of the accepted media types is available; available are: {0}")]
    NotAcceptable(&'static str),
    /// The method is not one of this resource's. 405.
    #[error("this resource does not have that method")]
    MethodNotAllowed,
    /// The representation is another one than If-Match names. 412.
    #[error("it is another version than If-Match names; ask for the whole again")]
    PreconditionFailed,
    /// The range lies outside the representation. 416.
    #[error("the range lies outside the {length} bytes")]
    RangeNotSatisfiable {
        /// Length of the whole representation.
        length: u64,
    },
    /// The series is not complete yet or has no reconstruction yet. 409.
    #[error("series {0} has no finished reconstruction yet")]
    SeriesIncomplete(SeriesInstanceUid),
    /// The identity of the series is being corrected: some of its instances came again with another
    /// one. 409.
    #[error(
        "the identity of series {0} is changing: some of its instances carry the corrected one, others not yet; send \
         all of them again with it"
    )]
    IdentityChanging(SeriesInstanceUid),
    /// The series can't be reconstructed. 409.
    #[error("series {uid} can't be reconstructed: {reason}{}", in_brackets(detail.as_deref()))]
    NotReconstructable {
        /// The series.
        uid: SeriesInstanceUid,
        /// The stable code of the reason.
        reason: String,
        /// What was found and the limit, where that is known.
        detail: Option<String>,
    },
    /// The reconstruction is not (yet) in a state that has this. 409.
    #[error("the reconstruction is {state}: {detail}")]
    ReconstructionState {
        /// Its state's name.
        state: &'static str,
        /// What the client can do.
        detail: String,
    },
    /// The series' latest revision has no cloud (yet), and no other was wanted. 409.
    #[error("revision {revision} of the series is {state}: {detail}")]
    NotCurrent {
        /// The latest revision.
        revision: u32,
        /// Its state's name.
        state: &'static str,
        /// What the client can do.
        detail: &'static str,
        /// When it may ask again, s.
        retry_after_s: u32,
    },
    /// The cloud's points carry no expected error to filter by. 409.
    #[error("{0}: reconstruct the series with {{\"profile\": \"precise\"}}, or leave out max_error_mm")]
    NoExpectedErrors(crate::cloud::NoErrors),
    /// The cloud that was asked for has no point: of that plane, or within that error. 422.
    #[error("{0}")]
    EmptyCloud(String),
    /// The source instances are no longer stored. 410.
    #[error("the source instances are no longer stored")]
    SourceRemoved,
    /// The body did not arrive in time. 408.
    #[error("the request did not arrive in time")]
    RequestTimeout,

    // ---- ourselves ----
    /// A stored result is not as it was written: its bytes changed, or a file is gone. 0110, 500.
    #[error(
        "the stored result of reconstruction {id} is damaged: {damage}; ask for the same reconstruction again \
         (POST /v1/series/…/reconstructions with its parameters) to have it made again, or bring the data \
         directory back from a copy, and look after the disk"
    )]
    ResultDamaged {
        /// The reconstruction.
        id: crate::store::ReconstructionId,
        /// What is wrong with which file.
        damage: String,
    },
    /// Something stored that this version of the software can't understand: a later one wrote it, or
    /// it is damaged. 0110, 500.
    #[error("{what} {id} can't be understood by this version of the software: {detail}")]
    Unreadable {
        /// What it is: `reconstruction`, `series`, …
        what: &'static str,
        /// Its id.
        id: String,
        /// Which part of it and why.
        detail: String,
    },
    /// A failure of our own: logged with its cause, told without it. 0110, 500.
    #[error("internal error; the service's log has the cause")]
    Internal(#[source] Box<dyn std::error::Error + Send + Sync>),
}

fn in_brackets(detail: Option<&str>) -> String {
    detail.map_or_else(String::new, |detail| format!(" ({detail})"))
}

/// How an [`Error`] is told to a peer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mapping {
    /// The last part of `urn:triplanar:problem:…`; also the label in logs and metrics.
    pub code: &'static str,
    /// A short title, the same for each occurrence.
    pub title: &'static str,
    /// DIMSE status of a C-STORE-RSP.
    pub dimse_status: u16,
    /// HTTP status.
    pub http_status: u16,
}

impl Error {
    /// A failure of our own.
    pub fn internal(cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Internal(cause.into())
    }

    /// A file of a reconstruction's result can't be read.
    pub(crate) fn of_result(id: crate::store::ReconstructionId, error: std::io::Error) -> Self {
        let cause = error.get_ref();
        let damage = cause.and_then(|cause| cause.downcast_ref::<crate::store::Damage>());
        let no_cloud = cause.and_then(|cause| cause.downcast_ref::<crate::cloud::ply::PlyError>());
        match damage.map(ToString::to_string).or_else(|| no_cloud.map(ToString::to_string)) {
            Some(damage) => Self::ResultDamaged { id, damage },
            None => error.into(),
        }
    }

    /// Whether it lies with the machine at the moment, not with the request: what was refused may go
    /// through unchanged when there is room again.
    #[must_use]
    pub fn is_shortage(&self) -> bool {
        matches!(
            self,
            Self::OutOfStorage
                | Self::OutOfDescriptors
                | Self::OutOfMemory
                | Self::NotPermitted
                | Self::CatalogDamaged
                | Self::Busy(_)
        )
    }

    /// The one table from error to DIMSE status and HTTP problem.
    #[must_use]
    pub fn mapping(&self) -> Mapping {
        let (code, title, dimse_status, http_status) = match self {
            Self::NotDicom(_) => ("not-dicom", "Not DICOM", 0xC000, 400),
            Self::MalformedDataSet(_) => ("malformed-data-set", "Malformed data set", 0xC001, 422),
            Self::MissingAttribute { .. } => ("missing-attribute", "Missing attribute", 0xC002, 422),
            Self::PixelDataSize(_) => ("pixel-data-size", "Pixel data of another size", 0xC007, 422),
            Self::ConflictingInstance(_) => ("conflicting-instance", "Conflicting instance", 0xC003, 409),
            Self::IncomparableInstance(_) => ("incomparable-instance", "Incomparable instance", 0xC009, 409),
            Self::TooLargeToCompare(..) => ("too-large-to-compare", "Too large to compare", 0xC009, 409),
            Self::ConflictingSeries(_) => ("conflicting-series", "Conflicting series", 0xC004, 409),
            Self::ConflictingStudy(_) => ("conflicting-study", "Conflicting study", 0xC006, 409),
            Self::ConflictingIdentity(_) => ("conflicting-identity", "Conflicting identity", 0xC008, 409),
            Self::SeriesFull { .. } => ("series-full", "Series full", 0xA700, 413),
            Self::UnsupportedTransferSyntax(_) => {
                ("unsupported-transfer-syntax", "Unsupported transfer syntax", 0xC005, 415)
            }
            Self::UnsupportedSopClass(_) => ("unsupported-sop-class", "Unsupported SOP class", 0x0122, 422),
            Self::DataSetMismatch(_) => ("data-set-mismatch", "Data set mismatch", 0xA900, 422),
            Self::TooLarge { .. } => ("too-large", "Too large", 0xA700, 413),
            Self::OutOfStorage => ("out-of-storage", "Out of storage", 0xA700, 507),
            Self::StoredDamaged(_) => ("stored-damaged", "Stored data damaged", 0x0110, 500),
            Self::OutOfDescriptors => ("out-of-descriptors", "Out of file descriptors", 0xA700, 503),
            Self::OutOfMemory => ("out-of-memory", "Out of memory", 0xA700, 503),
            Self::NotPermitted => ("not-permitted", "No rights to the data directory", 0xA700, 503),
            Self::CatalogDamaged => ("catalog-damaged", "Catalog damaged", 0xA700, 503),
            Self::Busy(_) => ("busy", "Busy", 0xA700, 503),
            Self::ShuttingDown => ("shutting-down", "Shutting down", 0xA700, 503),
            Self::MalformedUpload(_) => ("malformed-upload", "Malformed upload", 0xC000, 400),
            Self::ArchiveTooLarge(_) => ("archive-too-large", "Archive too large", 0xA700, 413),
            Self::EmptyUpload => ("empty-upload", "Nothing to store", 0xC000, 422),
            Self::Unauthorized => ("unauthorized", "Unauthorized", 0x0124, 401),
            Self::Forbidden(_) => ("forbidden", "Forbidden", 0x0124, 403),
            Self::InvalidHost(_) => ("invalid-host", "Invalid host", 0x0115, 400),
            Self::MisdirectedRequest => ("misdirected-request", "Misdirected request", 0x0112, 421),
            Self::ForeignOrigin => ("foreign-origin", "Foreign origin", 0x0124, 403),
            Self::NotFound { .. } | Self::NoSuchPath => ("not-found", "Not found", 0x0112, 404),
            Self::InvalidParameter { .. } => ("invalid-parameter", "Invalid parameter", 0x0115, 400),
            Self::InvalidBody(_) => ("invalid-body", "Invalid body", 0x0115, 422),
            Self::UnsupportedMediaType(_) => {
                ("unsupported-media-type", "Unsupported media type", 0x0115, 415)
            }
            Self::NotAcceptable(_) => ("not-acceptable", "Not acceptable", 0x0115, 406),
            Self::MethodNotAllowed => ("method-not-allowed", "Method not allowed", 0x0211, 405),
            Self::PreconditionFailed => ("precondition-failed", "Precondition failed", 0x0115, 412),
            Self::RangeNotSatisfiable { .. } => {
                ("range-not-satisfiable", "Range not satisfiable", 0x0115, 416)
            }
            Self::SeriesIncomplete(_) => ("series-incomplete", "Series incomplete", 0x0110, 409),
            Self::IdentityChanging(_) => ("identity-changing", "Identity changing", 0x0110, 409),
            Self::NotReconstructable { .. } => ("not-reconstructable", "Not reconstructable", 0x0110, 409),
            Self::ReconstructionState { .. } => ("reconstruction-state", "Not in that state", 0x0110, 409),
            Self::NotCurrent { .. } => ("not-current", "Latest revision not there", 0x0110, 409),
            Self::NoExpectedErrors(_) => ("no-expected-errors", "No expected errors", 0x0110, 409),
            Self::EmptyCloud(_) => ("empty-cloud", "Empty cloud", 0x0110, 422),
            Self::SourceRemoved => ("source-removed", "Source removed", 0x0110, 410),
            Self::RequestTimeout => ("request-timeout", "Request timeout", 0x0110, 408),
            Self::ResultDamaged { .. } => ("result-damaged", "Result damaged", 0x0110, 500),
            Self::Unreadable { .. } => ("unreadable", "Stored by another version", 0x0110, 500),
            Self::Internal(_) => ("internal", "Internal error", 0x0110, 500),
        };
        Mapping { code, title, dimse_status, http_status }
    }
}

impl From<crate::cloud::Unfiltered> for Error {
    fn from(error: crate::cloud::Unfiltered) -> Self {
        match error {
            crate::cloud::Unfiltered::NoErrors(error) => Self::NoExpectedErrors(error),
            nothing_left => Self::EmptyCloud(format!("{nothing_left}; ask for a larger max_error_mm")),
        }
    }
}

impl From<ScanError> for Error {
    fn from(error: ScanError) -> Self {
        match error {
            ScanError::NotDicom(detail) => Self::NotDicom(detail),
            ScanError::Malformed(detail) => Self::MalformedDataSet(detail),
            ScanError::Missing { attribute } => Self::MissingAttribute { attribute },
            ScanError::UnsupportedTransferSyntax(uid) => Self::UnsupportedTransferSyntax(uid),
            ScanError::UnsupportedSopClass(uid) => Self::UnsupportedSopClass(uid),
            ScanError::InflatesTooMuch { limit_bytes } => {
                Self::TooLarge { limit_bytes, setting: "intake.max_inflated_bytes" }
            }
            ScanError::NoMemory(error) => error.into(),
            ScanError::Stopped => Self::ShuttingDown,
            ScanError::Io(error) => error.into(),
        }
    }
}

impl From<crate::memory::NoMemory> for Error {
    fn from(_: crate::memory::NoMemory) -> Self {
        Self::Busy("the memory budget is in use (memory.budget_bytes)")
    }
}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        use std::io::ErrorKind;
        // EMFILE and ENFILE have no kind of their own in the standard library.
        match (error.kind(), error.raw_os_error()) {
            (ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge, _) => {
                Self::OutOfStorage
            }
            (_, Some(EMFILE | ENFILE)) => Self::OutOfDescriptors,
            (ErrorKind::OutOfMemory, _) => Self::OutOfMemory,
            (ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem, _) => {
                tracing::error!(%error, "no rights to read or write");
                Self::NotPermitted
            }
            _ => Self::internal(error),
        }
    }
}

/// Too many open files of this process, and of the system (`errno.h` of Linux).
const EMFILE: i32 = 24;
const ENFILE: i32 = 23;

impl From<sqlx::Error> for Error {
    fn from(error: sqlx::Error) -> Self {
        if matches!(error, sqlx::Error::PoolTimedOut) {
            return Self::Busy("the catalog has too much to do");
        }
        if let sqlx::Error::Io(cause) = error {
            return cause.into();
        }
        let code = error.as_database_error().and_then(|error| error.code());
        match code.and_then(|code| code.parse().ok()) {
            // SQLITE_FULL, SQLITE_IOERR_SHMSIZE: the catalog, or the index of its log, could not grow.
            Some(13 | 4874) => Self::OutOfStorage,
            // SQLITE_NOMEM, SQLITE_IOERR_NOMEM.
            Some(7 | 3082) => Self::OutOfMemory,
            // SQLITE_CORRUPT, SQLITE_NOTADB, and those that are kinds of them.
            Some(code) if matches!(code & 0xFF, 11 | 26) => {
                tracing::error!(%error, "the catalog is damaged");
                Self::CatalogDamaged
            }
            _ => Self::internal(error),
        }
    }
}
