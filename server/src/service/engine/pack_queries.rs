//! Queries of world packs: `packs` and `pack_put`.

use wheelarm_proto::{Message, v1};

use super::Engine;
use super::queries::decode;
use crate::service::packs;
use crate::service::uploads::Added;

impl Engine {
    /// Lists the world packs on another thread.
    pub(super) fn answer_packs(&self, query: zenoh::query::Query) {
        let known = self.options.packs.clone();
        let stamp = self.stamp();
        let header = stamp.clone();
        let make = move || Ok(packs::list(&known, header));
        self.shared.replies.answer_later(query, stamp, make);
    }

    /// Adds a piece of a world pack; stores the pack with its last piece, on another thread.
    pub(super) fn answer_pack_put(&mut self, query: zenoh::query::Query, payload: &[u8]) {
        let stamp = self.stamp();
        let added = decode::<v1::PackPutRequest>(payload)
            .and_then(|request| Ok((self.uploads.add(&request)?, request.zip_digest)));
        let (zip, digest) = match added {
            Ok((Added::Whole(zip), digest)) => (zip, digest),
            Ok((Added::Part(received), _)) => {
                let reply = v1::PackPutReply {
                    header: Some(stamp),
                    received,
                    pack: None,
                };
                return self.reply(query, Ok(reply.encode_to_vec()));
            }
            Err(why) => return self.refuse(query, why),
        };
        let (known, folder) = (self.options.packs.clone(), self.sim.assets().to_owned());
        let header = Some(stamp.clone());
        self.shared.replies.answer_later(query, stamp, move || {
            let pack = packs::store(&folder, &known, &zip, &digest)?;
            let reply = v1::PackPutReply {
                header,
                received: zip.len() as u64,
                pack: Some(pack),
            };
            Ok(reply.encode_to_vec().into())
        });
    }
}
