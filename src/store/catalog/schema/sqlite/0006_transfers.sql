-- Transfers that broke off, each with what is known of it, and instances that were refused.

-- When the sender began, in the order of its process' begins and breaks, and through which door.
ALTER TABLE open_senders ADD COLUMN begun BIGINT NOT NULL DEFAULT 0;
ALTER TABLE open_senders ADD COLUMN is_upload BOOLEAN NOT NULL DEFAULT FALSE;

-- What a sender brought: kept while it is open, and while its break is held against the series.
CREATE TABLE sent_instances (
    sender     TEXT    NOT NULL,
    series_uid TEXT    NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    sop_uid    TEXT    NOT NULL,
    is_new     BOOLEAN NOT NULL,
    PRIMARY KEY (sender, sop_uid)
);
CREATE INDEX sent_instances_by_series ON sent_instances (series_uid);

CREATE TABLE broken_transfers (
    sender      TEXT    NOT NULL,
    series_uid  TEXT    NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    sender_end  TEXT    NOT NULL,
    process     TEXT    NOT NULL,
    -- When, in the same order as open_senders.begun.
    broken      BIGINT  NOT NULL,
    -- Only a sender that brings again all that this one brought makes it good: a request is repeated
    -- whole, an association may be gone on with.
    must_repeat BOOLEAN NOT NULL,
    PRIMARY KEY (series_uid, sender)
);

-- Instances that were under way when it broke off.
CREATE TABLE cut_instances (
    sender     TEXT NOT NULL,
    series_uid TEXT NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    sop_uid    TEXT NOT NULL,
    PRIMARY KEY (series_uid, sender, sop_uid)
);

INSERT INTO broken_transfers (sender, series_uid, sender_end, process, broken, must_repeat)
SELECT 'earlier', series_uid, COALESCE(sender_end, 'association_lost'), '', 0, FALSE
FROM series WHERE incomplete_transfer;

-- It was complete with fewer instances than were announced.
ALTER TABLE series ADD COLUMN short_of_expected BOOLEAN NOT NULL DEFAULT FALSE;

-- Whether the refusal is a doubt of its series; of which study the instance was, if of another one.
ALTER TABLE refused ADD COLUMN held BOOLEAN NOT NULL DEFAULT FALSE;
ALTER TABLE refused ADD COLUMN study_uid TEXT;
UPDATE refused SET held = TRUE WHERE code <> 'unsupported-sop-class' AND NOT EXISTS (
    SELECT 1 FROM instances i WHERE i.sop_uid = refused.sop_uid AND i.series_uid = refused.series_uid
);

-- The doubts of the transfer of the revision that it is of, joined by commas.
ALTER TABLE reconstructions ADD COLUMN transfer_doubts TEXT NOT NULL DEFAULT '';
UPDATE reconstructions SET transfer_doubts = 'incomplete_transfer' WHERE EXISTS (
    SELECT 1 FROM series s WHERE s.series_uid = reconstructions.series_uid AND s.incomplete_transfer
    AND s.instances_sha256 = reconstructions.instances_sha256
);
UPDATE reconstructions
SET transfer_doubts = CASE transfer_doubts WHEN '' THEN 'instances_refused' ELSE transfer_doubts || ',instances_refused' END
WHERE EXISTS (
    SELECT 1 FROM series s JOIN refused r ON r.series_uid = s.series_uid AND r.held
    WHERE s.series_uid = reconstructions.series_uid AND s.instances_sha256 = reconstructions.instances_sha256
);
