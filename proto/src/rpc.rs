//! The queries of `service Simulation`: the type of a request determines the query and
//! the reply.

use prost::Message;

/// A request of a query.
pub trait Rpc: Message + Default {
    /// The query.
    const QUERY: Query;
    /// Type of the reply.
    type Reply: Message + Default;
    /// Last chunk of its key.
    const NAME: &'static str = Self::QUERY.name();

    /// The client's name in the key, where the key contains one.
    fn identity(&self) -> Option<&str> {
        None
    }
}

include!(concat!(env!("OUT_DIR"), "/rpc.rs"));

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;

    #[test]
    fn a_request_names_its_query() {
        assert_eq!(v1::EpisodeStartRequest::NAME, "episode_start");
        assert_eq!(v1::ResetRequest::QUERY, Query::Reset);
        assert!(Query::Status.only_looks() && !Query::Lease.only_looks());
        let request = v1::LeaseRequest {
            commander: "anna".to_owned(),
            ..v1::LeaseRequest::default()
        };
        assert_eq!(request.identity(), Some("anna"));
        assert_eq!(v1::StatusRequest {}.identity(), None);
        let names = ["wheelarm.v1.LeaseRequest", "wheelarm.v1.LeaseReply"];
        assert_eq!(Query::Lease.messages(), names);
    }
}
