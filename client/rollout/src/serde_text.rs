//! Contract messages and named settings as JSON strings.

/// A message of the contract as text: protobuf in base64.
pub(crate) mod message {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};
    use wheelarm_proto::Message;

    pub(crate) fn serialize<M: Message, S: Serializer>(
        message: &M,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.serialize_str(&STANDARD.encode(message.encode_to_vec()))
    }

    pub(crate) fn deserialize<'de, M: Message + Default, D: Deserializer<'de>>(
        from: D,
    ) -> Result<M, D::Error> {
        let text = String::deserialize(from)?;
        let bytes = STANDARD.decode(text).map_err(D::Error::custom)?;
        M::decode(&*bytes).map_err(D::Error::custom)
    }
}

/// A setting by its name.
pub(crate) mod named {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};
    use wheelarm_proto::settings::Named;

    pub(crate) fn serialize<N: Named, S: Serializer>(value: &N, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(value.name())
    }

    pub(crate) fn deserialize<'de, N: Named, D: Deserializer<'de>>(from: D) -> Result<N, D::Error> {
        N::from_name(&String::deserialize(from)?).map_err(D::Error::custom)
    }
}
