-- One row: which log (write-ahead log) belongs to which state of this file. `current` names the file since
-- its last checkpoint, `base` the file on which the log began (several names, with a space between, where a
-- checkpoint was not done at once); see `generation.rs`.
CREATE TABLE generation (
    id      BIGINT NOT NULL PRIMARY KEY,
    base    TEXT   NOT NULL,
    current TEXT   NOT NULL
);
INSERT INTO generation (id, base, current) VALUES (1, '', '');
