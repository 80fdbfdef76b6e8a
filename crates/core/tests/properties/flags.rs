//! Flags: their bits and names, and a set of them from names.

use crate::supervision::flags::{Flag, Flags};

#[test]
fn flags_have_distinct_bits_and_names() {
    let mut seen = Flags::NONE;
    for flag in Flag::ALL {
        assert!(!seen.contains(*flag));
        seen = seen.union(Flags::of(*flag));
        assert_eq!(Flag::from_name(flag.name()), Some(*flag));
    }
    assert!(seen.iter().eq(Flag::ALL.iter().copied()));
    assert!(seen.difference(seen).is_empty());
    assert_eq!(Flag::from_name("nothing"), None);
}

#[cfg(feature = "serde")]
#[test]
fn a_set_is_deserialized_from_names() {
    use serde::de::Deserialize;
    use serde::de::value::{Error, SeqDeserializer};
    let flags = |names: &[&'static str]| {
        Flags::deserialize(SeqDeserializer::<_, Error>::new(names.iter().copied()))
    };
    let lost_and_late = Flags::of(Flag::Lost).union(Flags::of(Flag::Late));
    assert_eq!(flags(&["lost", "late"]), Ok(lost_and_late));
    assert_eq!(flags(&[]), Ok(Flags::NONE));
    assert!(flags(&["lost", "frost"]).is_err());
}

#[cfg(feature = "serde")]
#[test]
fn errors_of_type_state_what_is_expected() {
    use serde::de::value::{Error, U32Deserializer};
    use serde::de::{Deserialize, IntoDeserializer};
    let number = || -> U32Deserializer<Error> { 1_u32.into_deserializer() };
    let error = Flags::deserialize(number()).unwrap_err().to_string();
    assert!(error.contains("a sequence of names of flags"), "{error}");
    let error = Flag::deserialize(number()).unwrap_err().to_string();
    assert!(error.contains("the name of a flag"), "{error}");
}
