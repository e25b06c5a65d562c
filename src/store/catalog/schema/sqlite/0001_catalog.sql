-- Times are Unix milliseconds, UTC. UIDs are the DICOM text, ids are UUIDs as text.

CREATE TABLE series (
    series_uid             TEXT   NOT NULL PRIMARY KEY,
    study_uid              TEXT   NOT NULL,
    frame_of_reference_uid TEXT,
    modality               TEXT,
    description            TEXT,
    patient_id             TEXT,
    accession_number       TEXT,
    state                  TEXT   NOT NULL,
    unfit_reason           TEXT,
    -- Counts the sets of instances that were complete; 0 before the first.
    revision               BIGINT NOT NULL,
    complete_reason        TEXT,
    -- Identity of the set of instances of that revision.
    instances_sha256       BLOB,
    instances              BIGINT NOT NULL,
    bytes                  BIGINT NOT NULL,
    created_ms             BIGINT NOT NULL,
    updated_ms             BIGINT NOT NULL,
    -- While receiving: when it is complete if nothing more happens, and for which reason then.
    due_ms                 BIGINT,
    due_reason             TEXT
);
CREATE INDEX series_by_age ON series (created_ms, series_uid);
CREATE INDEX series_by_due ON series (due_ms) WHERE due_ms IS NOT NULL;

CREATE TABLE instances (
    sop_uid                TEXT   NOT NULL PRIMARY KEY,
    series_uid             TEXT   NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    study_uid              TEXT   NOT NULL,
    sop_class_uid          TEXT   NOT NULL,
    transfer_syntax_uid    TEXT   NOT NULL,
    frame_of_reference_uid TEXT,
    modality               TEXT,
    -- Values joined by backslashes, as DICOM does.
    image_type             TEXT   NOT NULL,
    description            TEXT,
    patient_id             TEXT,
    accession_number       TEXT,
    frames                 BIGINT NOT NULL,
    pixel_rows             BIGINT,
    pixel_columns          BIGINT,
    has_pixel_data         BOOLEAN NOT NULL,
    blob                   TEXT   NOT NULL,
    size                   BIGINT NOT NULL,
    data_set_sha256        BLOB   NOT NULL,
    received_ms            BIGINT NOT NULL,
    -- The first revision of the series that it belongs to; null until that is complete.
    revision               BIGINT
);
CREATE INDEX instances_by_series ON instances (series_uid, sop_uid);

-- No reference to series: an instance can be refused before its series has any.
CREATE TABLE refused (
    series_uid TEXT   NOT NULL,
    sop_uid    TEXT   NOT NULL,
    code       TEXT   NOT NULL,
    times      BIGINT NOT NULL,
    last_ms    BIGINT NOT NULL,
    PRIMARY KEY (series_uid, sop_uid, code)
);

-- The number of instances that a sender announced; may be known before the first one comes.
CREATE TABLE expectations (
    series_uid         TEXT   NOT NULL PRIMARY KEY,
    expected_instances BIGINT NOT NULL,
    set_ms             BIGINT NOT NULL
);

-- Associations and uploads that have sent something of a series and have not ended.
CREATE TABLE open_senders (
    sender     TEXT   NOT NULL,
    series_uid TEXT   NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    -- The process that serves it: senders of a dead process have ended.
    process    TEXT   NOT NULL,
    heard_ms   BIGINT NOT NULL,
    PRIMARY KEY (sender, series_uid)
);
CREATE INDEX open_senders_by_series ON open_senders (series_uid);

-- One row is both the reconstruction and its job.
CREATE TABLE reconstructions (
    id                 TEXT   NOT NULL PRIMARY KEY,
    series_uid         TEXT   NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    revision           BIGINT NOT NULL,
    instances_sha256   BLOB   NOT NULL,
    instances          BIGINT NOT NULL,
    parameters         TEXT   NOT NULL,
    parameters_sha256  BLOB   NOT NULL,
    software           TEXT   NOT NULL,
    state              TEXT   NOT NULL,
    stage              TEXT,
    fraction           DOUBLE PRECISION NOT NULL,
    attempts           BIGINT NOT NULL,
    error_code         TEXT,
    error_detail       TEXT,
    error_instances    TEXT   NOT NULL,
    superseded_by      TEXT,
    figures            TEXT,
    -- Prefix of its blobs, if it has any.
    result             TEXT,
    has_report         BOOLEAN NOT NULL,
    created_ms         BIGINT NOT NULL,
    started_ms         BIGINT,
    finished_ms        BIGINT,
    -- The job: not claimed before that time; by whom, until when, with which fencing token.
    not_before_ms      BIGINT NOT NULL,
    worker             TEXT,
    lease_until_ms     BIGINT,
    fence              BIGINT NOT NULL,
    cancel_requested   BOOLEAN NOT NULL,
    UNIQUE (series_uid, instances_sha256, parameters_sha256)
);
CREATE INDEX reconstructions_by_state ON reconstructions (state, not_before_ms, id);
