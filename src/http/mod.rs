//! REST, STOW-RS and upload in; clouds, reports, events, health and metrics out.
