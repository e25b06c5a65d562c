-- Corrections of other attributes of stored instances than the identity: how many instances came, and when the
-- last one did; never what they say.
CREATE TABLE attribute_changes (
    series_uid TEXT   NOT NULL REFERENCES series (series_uid) ON DELETE CASCADE,
    instances  BIGINT NOT NULL,
    changed_ms BIGINT NOT NULL
);
CREATE INDEX attribute_changes_by_series ON attribute_changes (series_uid);
