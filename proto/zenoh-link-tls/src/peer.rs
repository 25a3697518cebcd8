//! The peer of a connection, identified by its certificates.

use time::OffsetDateTime;
use tokio_rustls::rustls::pki_types::CertificateDer;
use x509_parser::prelude::{FromDer, X509Certificate};
use zenoh_result::{ZResult, zerror};

/// The peer of a connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Peer {
    /// Common name of its own certificate, which decides about access. `None` without a name or
    /// when it is not text: the peer gets no rights.
    pub name: Option<String>,
    /// Start of validity of its own certificate.
    pub since: OffsetDateTime,
    /// Earliest end of validity of its certificates.
    pub until: OffsetDateTime,
}

impl Peer {
    /// # Errors
    /// Without a certificate, or with an unreadable one.
    pub fn of(chain: Option<&[CertificateDer<'_>]>) -> ZResult<Self> {
        let chain = chain.unwrap_or_default();
        let read = chain.iter().map(|der| {
            let (_, certificate) = X509Certificate::from_der(der)?;
            let mut names = certificate.subject().iter_common_name();
            let name = names.next().and_then(|name| name.as_str().ok());
            Ok::<_, zenoh_result::Error>(Self {
                name: name.map(str::to_owned),
                since: certificate.validity().not_before.to_datetime(),
                until: certificate.validity().not_after.to_datetime(),
            })
        });
        let read: Vec<Self> = read.collect::<ZResult<_>>()?;
        let until = read.iter().map(|of| of.until).min();
        let until = until.ok_or_else(|| zerror!("the peer sent no certificate"))?;
        let own = read.into_iter().next();
        let own = own.ok_or_else(|| zerror!("the peer sent no certificate"))?;
        Ok(Self { until, ..own })
    }
}
