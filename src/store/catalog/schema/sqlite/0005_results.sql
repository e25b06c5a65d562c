-- What a result is made by, which one is clinical, what is known of the transfer.

-- The algorithm and its version, e.g. precise/1. Null until a row of 0.1 has been looked at (see
-- `identity.rs`); null for good where its parameters can't be read.
ALTER TABLE reconstructions ADD COLUMN algorithm TEXT;
-- Identity of the parameters that have an effect, whatever the algorithm's version.
-- `parameters_sha256` is that of both.
ALTER TABLE reconstructions ADD COLUMN settings_sha256 BLOB;

-- The revision of the series for which the service queued it itself.
ALTER TABLE reconstructions ADD COLUMN queued_for BIGINT;
-- The revision at which an operator chose it to be the clinical one.
ALTER TABLE reconstructions ADD COLUMN chosen_for BIGINT;
-- In 0.1 the transaction that completed a revision queued its job, so it is the earliest. Ids are in
-- the order of time.
UPDATE reconstructions SET queued_for = revision WHERE id = (
    SELECT MIN(other.id) FROM reconstructions other
    WHERE other.series_uid = reconstructions.series_uid AND other.revision = reconstructions.revision
);

CREATE TABLE clinical_choices (
    series_uid        TEXT   NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    revision          BIGINT NOT NULL,
    -- Null: back to the one that the service queued itself.
    reconstruction_id TEXT,
    -- Name of the token; null without tokens.
    chosen_by         TEXT,
    chosen_ms         BIGINT NOT NULL
);
CREATE INDEX clinical_choices_by_series ON clinical_choices (series_uid, chosen_ms);

-- Whether what its slices' pictures are drawn from is stored with the result.
ALTER TABLE reconstructions ADD COLUMN has_pictures BOOLEAN NOT NULL DEFAULT FALSE;

-- How the sender that ended last ended.
ALTER TABLE series ADD COLUMN sender_end TEXT;
-- A sender broke off, and nothing has made the series whole since.
ALTER TABLE series ADD COLUMN incomplete_transfer BOOLEAN NOT NULL DEFAULT FALSE;
