-- Blobs whose rows were removed, until they are gone themselves: keys of instances, prefixes of results.
CREATE TABLE removed_blobs (
    blob TEXT NOT NULL PRIMARY KEY
);
-- One row, written to see whether the catalog can be.
CREATE TABLE readiness (
    id         BIGINT NOT NULL PRIMARY KEY,
    written_ms BIGINT NOT NULL
);
-- When a fault that the process survived first put it back, without an attempt being counted.
ALTER TABLE reconstructions ADD COLUMN deferred_since_ms BIGINT;
-- How long the wait until not_before_ms was meant to be: farther away than that, the clock was set back.
ALTER TABLE reconstructions ADD COLUMN wait_ms BIGINT NOT NULL DEFAULT 0;
