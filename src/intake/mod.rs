//! Makes an instance durable, groups it into its series, notices that a series is complete.
