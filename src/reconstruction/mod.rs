//! The whole way from the instances of a series to clouds and report, without a service: what
//! `triplanar reconstruct` and the service's worker both call, so that they give the same bytes.
