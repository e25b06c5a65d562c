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

/// Why identities are not of one patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parting {
    /// The attribute says different things.
    Differs(IdentityField),
    /// Some have a Patient ID alone, others a Patient's Name alone, and none says which belong together.
    Unlinked,
}

impl fmt::Display for Parting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Differs(field) => write!(f, "{field} differs"),
            Self::Unlinked => f.write_str(
                "some have only a Patient ID, others only a Patient's Name, and no instance has both of them",
            ),
        }
    }
}

/// Why identities are not of one patient, and the sets into which that parts them: indices into `of`, the
/// larger set first. `None` if all can be of one patient.
///
/// Two identities are of different patients if Patient ID, Issuer of Patient ID, Patient's Name or
/// Patient's Birth Date stands in both and differs. Compared are an ID and its issuer as they are; of
/// the name the alphabetic group (the ideographic one among those without), by its components, without
/// regard to case, padding and empty components at the end; of the date its digits. An identity
/// without the attribute is in the set of those whose Patient ID or Patient's Name it shares, if that
/// is one.
///
/// Equal IDs or equal names link identities. An ID that no link connects with a name beside it is not
/// known to be that person's.
#[must_use]
pub fn parted(of: &[&Identity]) -> Option<(Parting, Vec<Vec<usize>>)> {
    let links = Links::of(of);
    let differs = PATIENT.iter().find_map(|(field, key)| {
        let mut sets: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        let mut without = Vec::new();
        for (index, identity) in of.iter().enumerate() {
            match key(identity) {
                Some(key) => sets.entry(key).or_default().push(index),
                None => without.push(index),
            }
        }
        let sets = sets.into_values().collect();
        Some((Parting::Differs(*field), links.completed(sets, &without)?))
    });
    let (parting, mut sets) = differs.or_else(|| Some((Parting::Unlinked, links.unlinked()?)))?;
    sets.sort_by_key(|set| std::cmp::Reverse(set.len()));
    Some((parting, sets))
}

/// What links identities: for each its Patient ID and its name, as they are compared.
struct Links(Vec<[Option<String>; 2]>);

impl Links {
    fn of(of: &[&Identity]) -> Self {
        let name = |identity: &Identity| group(identity, 0).or_else(|| group(identity, 1));
        Self(of.iter().map(|identity| [identity.patient_id.clone(), name(identity)]).collect())
    }

    fn link(&self, one: usize, other: usize) -> bool {
        self.0[one].iter().zip(&self.0[other]).any(|(one, other)| one.is_some() && one == other)
    }

    /// Several sets, with those `without` the attribute that are linked to one of them; `None` of one set.
    fn completed(&self, sets: Vec<Vec<usize>>, without: &[usize]) -> Option<Vec<Vec<usize>>> {
        if sets.len() < 2 {
            return None;
        }
        let mut completed = sets.clone();
        for &index in without {
            let linked = |set: &&Vec<usize>| set.iter().any(|member| self.link(index, *member));
            let mut to = sets.iter().enumerate().filter(|(_, set)| linked(set));
            if let (Some((set, _)), None) = (to.next(), to.next()) {
                completed[set].push(index);
                completed[set].sort_unstable();
            }
        }
        Some(completed)
    }

    /// Those with an ID and those with a name, if none has both. There is one of each at most here, or they
    /// would differ.
    fn unlinked(&self) -> Option<Vec<Vec<usize>>> {
        let with = |key: usize| (0..self.0.len()).filter(|i| self.0[*i][key].is_some()).collect::<Vec<_>>();
        let (ids, names) = (with(0), with(1));
        let is_linked = self.0.iter().any(|[id, name]| id.is_some() && name.is_some());
        (!ids.is_empty() && !names.is_empty() && !is_linked).then(|| vec![ids, names])
    }
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

    fn part(of: &[Identity]) -> Option<(Parting, Vec<Vec<usize>>)> {
        parted(&of.iter().collect::<Vec<_>>())
    }

    #[test]
    fn one_patient_may_be_written_in_several_ways() {
        let same = [
            named("DOE^JOHN"),
            named("Doe^John^^^ "),
            named(" doe ^john"),
            named("DOE^JOHN=\u{5c71}\u{7530}^\u{592a}\u{90ce}"),
            Identity { patient_id: Some("1".into()), ..named("DOE^JOHN") },
            Identity { patient_id: Some("1".into()), ..Identity::default() },
            Identity::default(),
        ];
        assert_eq!(part(&same), None);
        // Without a name, or without an ID, anywhere.
        let only = |id: &str| Identity { patient_id: Some(id.into()), ..Identity::default() };
        assert_eq!(part(&[only("1"), Identity::default(), only("1")]), None);
        assert_eq!(part(&same[..4]), None);
    }

    #[test]
    fn an_id_without_a_name_is_nobodys_whose_name_stands_without_an_id() {
        let id = |id: &str| Identity { patient_id: Some(id.into()), ..Identity::default() };
        let both = |of: &str, name: &str| Identity { patient_id: Some(of.into()), ..named(name) };
        let nobody = Identity::default;
        let unlinked = [id("1"), nobody(), named("ROE^JANE"), named("Roe^Jane")];
        assert_eq!(part(&unlinked), Some((Parting::Unlinked, vec![vec![2, 3], vec![0]])));
        // One that has both links the others.
        assert_eq!(part(&[id("1"), named("ROE^JANE"), both("1", "ROE^JANE")]), None);
        assert_eq!(part(&[both("1", "ROE^JANE"), named("ROE^JANE"), id("1")]), None);
        // Those without the attribute that differs are of whom they share another one with.
        let differ = [both("1", "DOE^JOHN"), id("1"), named("ROE^JANE"), both("1", "DOE^JOHN"), id("1")];
        let name = Parting::Differs(IdentityField::PatientName);
        assert_eq!(part(&differ), Some((name, vec![vec![0, 1, 3, 4], vec![2]])));
        let differ = [both("1", "DOE^JOHN"), named("DOE^JOHN"), id("2"), nobody()];
        let patient_id = Parting::Differs(IdentityField::PatientId);
        assert_eq!(part(&differ), Some((patient_id, vec![vec![0, 1], vec![2]])));
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
            assert_eq!(part(&of), Some((Parting::Differs(field), vec![vec![1, 3], vec![0]])), "{field}");
        }
    }

    #[test]
    fn debug_shows_no_value() {
        let text = format!("{:?}", named("ZQMARK"));
        assert!(text.contains("PatientName") && !text.contains("ZQMARK"), "{text}");
    }
}
