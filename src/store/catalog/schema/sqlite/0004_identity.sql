-- What tells a slice from what else a series holds; null in rows of earlier versions.
ALTER TABLE instances ADD COLUMN photometric TEXT;
ALTER TABLE instances ADD COLUMN samples_per_pixel BIGINT;
ALTER TABLE instances ADD COLUMN has_position BOOLEAN;

-- Whom an instance shows, with patient_id and accession_number; read from the instance where
-- has_identity is not set (rows of earlier versions).
ALTER TABLE instances ADD COLUMN has_identity BOOLEAN NOT NULL DEFAULT FALSE;
ALTER TABLE instances ADD COLUMN issuer_of_patient_id TEXT;
ALTER TABLE instances ADD COLUMN patient_name TEXT;
ALTER TABLE instances ADD COLUMN patient_birth_date TEXT;
ALTER TABLE instances ADD COLUMN patient_sex TEXT;
-- What stands for the instance in the identity of its set: the hash of the data set that was stored first,
-- which one with a corrected identity leaves as it is. Null: data_set_sha256.
ALTER TABLE instances ADD COLUMN image_sha256 BLOB;
-- The change of identity in which the instance came or was confirmed last.
ALTER TABLE instances ADD COLUMN identity_round BIGINT NOT NULL DEFAULT 0;

-- Counts the changes of identity; while one is under way, what of it has changed, joined by commas.
ALTER TABLE series ADD COLUMN identity_round BIGINT NOT NULL DEFAULT 0;
ALTER TABLE series ADD COLUMN identity_changing TEXT;

-- What happened to a series' identity: kinds of attributes, never their values.
CREATE TABLE identity_changes (
    series_uid TEXT   NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    round      BIGINT NOT NULL,
    fields     TEXT   NOT NULL,
    changed_ms BIGINT NOT NULL,
    PRIMARY KEY (series_uid, round)
);

-- Blobs whose instance has another one now; kept while a reconstruction may read them.
CREATE TABLE replaced_blobs (
    blob       TEXT NOT NULL PRIMARY KEY,
    series_uid TEXT NOT NULL
);
CREATE INDEX replaced_blobs_by_series ON replaced_blobs (series_uid);
