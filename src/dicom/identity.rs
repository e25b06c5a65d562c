//! Whom an instance shows and which order it belongs to, and whether instances are of one patient.

use std::collections::BTreeMap;
use std::fmt;

use crate::named::named;

named! {
    /// What of an identity a correction changed.
    IdentityField {
        /// Patient ID (0010,0020).
        PatientId = "patient_id",
        /// Issuer of Patient ID (0010,0021).
        IssuerOfPatientId = "issuer_of_patient_id",
        /// Patient's Name (0010,0010).
        PatientName = "patient_name",
        /// Patient's Birth Date (0010,0030).
        PatientBirthDate = "patient_birth_date",
        /// Patient's Sex (0010,0040).
        PatientSex = "patient_sex",
        /// Accession Number (0008,0050).
        AccessionNumber = "accession_number",
    }
}

/// The attributes that a correction of a patient's identity changes, without padding, in the
/// characters that they stand for. `None` where an attribute is absent or empty.
///
/// Never logged: [`fmt::Debug`] tells which are there, not what they say.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Identity {
    /// Patient ID (0010,0020).
    pub patient_id: Option<String>,
    /// Issuer of Patient ID (0010,0021).
    pub issuer_of_patient_id: Option<String>,
    /// Patient's Name (0010,0010), all its component groups.
    pub patient_name: Option<String>,
    /// Patient's Birth Date (0010,0030).
    pub patient_birth_date: Option<String>,
    /// Patient's Sex (0010,0040).
    pub patient_sex: Option<String>,
    /// Accession Number (0008,0050).
    pub accession_number: Option<String>,
}

impl fmt::Debug for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let there = IdentityField::ALL.iter().filter(|field| self.get(**field).is_some());
        f.debug_set().entries(there).finish()
    }
}

impl Identity {
    /// The value of one attribute.
    #[must_use]
    pub fn get(&self, field: IdentityField) -> Option<&str> {
        match field {
            IdentityField::PatientId => self.patient_id.as_deref(),
            IdentityField::IssuerOfPatientId => self.issuer_of_patient_id.as_deref(),
            IdentityField::PatientName => self.patient_name.as_deref(),
            IdentityField::PatientBirthDate => self.patient_birth_date.as_deref(),
            IdentityField::PatientSex => self.patient_sex.as_deref(),
            IdentityField::AccessionNumber => self.accession_number.as_deref(),
        }
    }

    /// The attributes in which `other` says something else, be it by a letter's case.
    #[must_use]
    pub fn changed(&self, other: &Self) -> Vec<IdentityField> {
        IdentityField::ALL.iter().copied().filter(|field| self.get(*field) != other.get(*field)).collect()
    }
}

/// The attribute in which identities are not of one patient, and the sets into which it parts them:
/// indices into `of`, the larger set first. `None` if all can be of one patient.
///
/// Two identities are of different patients if Patient ID, Issuer of Patient ID, Patient's Name or
/// Patient's Birth Date stands in both and differs. Compared are an ID and its issuer as they are; of
/// the name the alphabetic group (the ideographic one among those without), by its components, without
/// regard to case, padding and empty components at the end; of the date its digits. An identity
/// without an attribute does not differ in it, and is in none of the sets.
#[must_use]
pub fn parted(of: &[&Identity]) -> Option<(IdentityField, Vec<Vec<usize>>)> {
    PATIENT.iter().find_map(|(field, key)| {
        let mut sets: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, identity) in of.iter().enumerate() {
            if let Some(key) = key(identity) {
                sets.entry(key).or_default().push(index);
            }
        }
        let mut sets: Vec<Vec<usize>> = sets.into_values().collect();
        sets.sort_by_key(|set| std::cmp::Reverse(set.len()));
        (sets.len() > 1).then_some((*field, sets))
    })
}

type Key = fn(&Identity) -> Option<String>;

/// What tells patients apart.
const PATIENT: [(IdentityField, Key); 5] = [
    (IdentityField::PatientId, |identity| identity.patient_id.clone()),
    (IdentityField::IssuerOfPatientId, |identity| identity.issuer_of_patient_id.clone()),
    (IdentityField::PatientName, |identity| group(identity, 0)),
    (
        IdentityField::PatientName,
        |identity| {
            if group(identity, 0).is_some() { None } else { group(identity, 1) }
        },
    ),
    (IdentityField::PatientBirthDate, |identity| {
        let digits: String =
            identity.patient_birth_date.as_deref()?.chars().filter(char::is_ascii_digit).collect();
        Some(digits).filter(|digits| !digits.is_empty())
    }),
];

/// A component group of the name (PS3.5 section 6.2.1.1), as it is compared.
fn group(identity: &Identity, index: usize) -> Option<String> {
    let group = identity.patient_name.as_deref()?.split('=').nth(index)?;
    let component = |text: &str| {
        let words: Vec<String> = text.split_whitespace().map(str::to_lowercase).collect();
        words.join(" ")
    };
    let components: Vec<String> = group.split('^').map(component).collect();
    let name = components.join("^");
    Some(name.trim_end_matches('^').to_owned()).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Identity {
        Identity { patient_name: Some(name.to_owned()), ..Identity::default() }
    }

    fn part(of: &[Identity]) -> Option<(IdentityField, Vec<Vec<usize>>)> {
        parted(&of.iter().collect::<Vec<_>>())
    }

    #[test]
    fn one_patient_may_be_written_in_several_ways() {
        let same = [
            named("DOE^JOHN"),
            named("Doe^John^^^ "),
            named(" doe ^john"),
            named("DOE^JOHN=\u{5c71}\u{7530}^\u{592a}\u{90ce}"),
            Identity { patient_id: Some("1".into()), ..Identity::default() },
            Identity::default(),
        ];
        assert_eq!(part(&same), None);
    }

    #[test]
    fn another_id_issuer_name_or_birth_date_is_another_patient() {
        let with = |field: IdentityField, value: &str| {
            let value = Some(value.to_owned());
            match field {
                IdentityField::PatientId => Identity { patient_id: value, ..Identity::default() },
                IdentityField::IssuerOfPatientId => {
                    Identity { issuer_of_patient_id: value, ..Identity::default() }
                }
                IdentityField::PatientName => Identity { patient_name: value, ..Identity::default() },
                _ => Identity { patient_birth_date: value, ..Identity::default() },
            }
        };
        for (field, one, other) in [
            (IdentityField::PatientId, "4711", "4712"),
            (IdentityField::IssuerOfPatientId, "A", "B"),
            (IdentityField::PatientName, "DOE^JOHN", "DOE^JANE"),
            (IdentityField::PatientName, "=\u{5c71}", "=\u{5ddd}"),
            (IdentityField::PatientBirthDate, "19500101", "1950.01.02"),
        ] {
            let of = [with(field, one), with(field, other), Identity::default(), with(field, other)];
            assert_eq!(part(&of), Some((field, vec![vec![1, 3], vec![0]])), "{field}");
        }
    }

    #[test]
    fn debug_shows_no_value() {
        let text = format!("{:?}", named("ZQMARK"));
        assert!(text.contains("PatientName") && !text.contains("ZQMARK"), "{text}");
    }
}
