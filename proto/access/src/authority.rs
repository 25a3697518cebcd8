//! The private certificate authority and its certificates: ECDSA over P-256.

use rcgen::{
    BasicConstraints, Certificate, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

use super::AccessError;

/// Shortest and longest validity of a user's certificate, days.
pub const SHORTEST_DAYS: u32 = 30;
/// See [`SHORTEST_DAYS`].
pub const LONGEST_DAYS: u32 = 365;

/// Validity of the authority and of the server's certificate, days.
const AUTHORITY_DAYS: i64 = 3650;
const SERVER_DAYS: i64 = 825;

/// Common name of the authority; its key distinguishes it from others of that name.
const AUTHORITY_NAME: &str = "WheelArm authority";

/// A certificate and its private key, PEM.
pub struct Pair {
    pub certificate: String,
    pub key: String,
}

/// Certificates are valid this long before they are issued, because clocks may differ.
const EARLY: Duration = Duration::days(1);

/// Time of issue of a certificate that is valid from `not_before`, both s since 1970.
pub fn issued(not_before: i64) -> i64 {
    not_before.saturating_add(EARLY.whole_seconds())
}

fn valid(params: &mut CertificateParams, days: i64) {
    let now = OffsetDateTime::now_utc();
    params.not_before = now - EARLY;
    params.not_after = now + Duration::days(days);
}

fn authority() -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = rcgen::DistinguishedName::new();
    let name = &mut params.distinguished_name;
    name.push(DnType::CommonName, AUTHORITY_NAME);
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    valid(&mut params, AUTHORITY_DAYS);
    params
}

fn pair(certificate: &Certificate, key: &KeyPair) -> Pair {
    Pair {
        certificate: certificate.pem(),
        key: key.serialize_pem(),
    }
}

/// A new authority.
pub fn new_authority() -> Result<Pair, AccessError> {
    let failed = || AccessError::crypto("cannot create an authority");
    let key = KeyPair::generate().map_err(failed())?;
    let certificate = authority().self_signed(&key).map_err(failed())?;
    Ok(pair(&certificate, &key))
}

/// Signs with the authority's private key, PEM.
fn signed(authority_key: &str, params: &CertificateParams) -> Result<Pair, AccessError> {
    let failed = || AccessError::crypto("cannot sign a certificate");
    let issuer = KeyPair::from_pem(authority_key).map_err(failed())?;
    let issuer = Issuer::new(authority(), issuer);
    let key = KeyPair::generate().map_err(failed())?;
    let certificate = params.signed_by(&key, &issuer).map_err(failed())?;
    Ok(pair(&certificate, &key))
}

/// A server's certificate, for its host names and addresses; the server also uses it
/// towards a router.
pub fn new_server(authority_key: &str, name: &str, hosts: &[String]) -> Result<Pair, AccessError> {
    let mut params = CertificateParams::new(hosts)
        .map_err(AccessError::crypto("cannot add the hosts to a certificate"))?;
    leaf(&mut params, name);
    params.extended_key_usages = vec![
        ExtendedKeyUsagePurpose::ServerAuth,
        ExtendedKeyUsagePurpose::ClientAuth,
    ];
    valid(&mut params, SERVER_DAYS);
    signed(authority_key, &params)
}

/// A user's certificate. `days` may be 0 or less for an expired one.
pub fn new_user(authority_key: &str, name: &str, days: i64) -> Result<Pair, AccessError> {
    let mut params = CertificateParams::default();
    leaf(&mut params, name);
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
    valid(&mut params, days);
    params.not_before -= Duration::days((-days).max(0));
    signed(authority_key, &params)
}

fn leaf(params: &mut CertificateParams, name: &str) {
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    params.is_ca = IsCa::ExplicitNoCa;
    params.use_authority_key_identifier_extension = true;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
}

/// Last day, `YYYY-MM-DD`, of a validity of `days` from now.
pub fn last_day(days: i64) -> String {
    let day = (OffsetDateTime::now_utc() + Duration::days(days)).date();
    format!(
        "{:04}-{:02}-{:02}",
        day.year(),
        u8::from(day.month()),
        day.day()
    )
}
