-- How far a result can be trusted, as JSON; null where its profile does not tell.
ALTER TABLE reconstructions ADD COLUMN quality TEXT;
