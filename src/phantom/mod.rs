//! A synthetic head CT whose skin is known exactly.
