-- The files of a result, as JSON: by name the hash over the hashes of its blocks. Null: no result, or one
-- of release 0.1, which wrote no hashes.
ALTER TABLE reconstructions ADD COLUMN result_files TEXT;
