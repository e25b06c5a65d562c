//! Where the air of the survey's cells leads.

/// The air of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Air {
    /// None: the patient, or what else no air passes.
    Solid,
    /// Air outside.
    Open,
    /// Air in a nostril, an ear canal, the slit of a mouth.
    Canal,
    /// Air that the ball does not reach.
    Enclosed,
    /// What shuts the openings where the border of the field of view cuts the patient.
    Shut,
}
