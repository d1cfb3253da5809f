#include "client/pki/certificate_authority.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/x509v3.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/security/roles.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAuthority = "ca";
using Extension = std::unique_ptr<X509_EXTENSION, Free<X509_EXTENSION_free>>;
using Name = std::unique_ptr<X509_NAME, Free<X509_NAME_free>>;
using Number = std::unique_ptr<BIGNUM, Free<BN_free>>;

absl::Status openssl_error(const char* what) {
  const char* reason = ERR_reason_error_string(ERR_peek_last_error());
  ERR_clear_error();
  return absl::InternalError(
      fmt::format("cannot make {}: {}", what, reason == nullptr ? "OpenSSL fails" : reason));
}

// Holds the lock until the result is destroyed.
absl::StatusOr<std::shared_ptr<const void>> lock_directory(const fs::path& directory) {
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return absl::ErrnoToStatus(errno, fmt::format("cannot open {}", directory.string()));
  const std::shared_ptr<const void> lock(nullptr, [fd](const void*) { ::close(fd); });
  if (::flock(fd, LOCK_EX) != 0)
    return absl::ErrnoToStatus(errno, fmt::format("cannot lock {}", directory.string()));
  return lock;
}

absl::Status make_directory(const fs::path& directory) {
  const fs::path absolute = fs::absolute(directory).lexically_normal();
  if (::mkdir(directory.c_str(), 0700) == 0)
    return flush_directory(absolute.has_filename() ? absolute.parent_path()
                                                   : absolute.parent_path().parent_path());
  if (errno == EEXIST) return absl::OkStatus();
  return absl::ErrnoToStatus(errno, fmt::format("cannot make {}", directory.string()));
}

Name name_of(const std::string& common_name) {
  Name name(X509_NAME_new());
  X509_NAME_add_entry_by_txt(name.get(), "CN", MBSTRING_UTF8,
                             reinterpret_cast<const unsigned char*>(common_name.c_str()), -1, -1, 0);
  return name;
}

bool extend(X509* certificate, X509* issuer, int what, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, what, value));
  return extension != nullptr && X509_add_ext(certificate, extension.get(), -1) == 1;
}

bool give_serial(X509* certificate) {
  constexpr int kBits = 127;  // positive, of at most 20 octets (RFC 5280, 4.1.2.2)
  const Number serial(BN_new());
  return BN_rand(serial.get(), kBits, BN_RAND_TOP_ANY, BN_RAND_BOTTOM_ANY) == 1 &&
         BN_to_ASN1_INTEGER(serial.get(), X509_get_serialNumber(certificate)) != nullptr;
}

// Makes a certificate signed with `signer`, the key of `issuer`; without an issuer it is self-signed. Null:
// OpenSSL provides the reason.
Certificate made_certificate(const X509_NAME& subject, EVP_PKEY& key, int days, X509* issuer,
                             EVP_PKEY& signer, X509_EXTENSION* names) {
  constexpr long kSlowClocks_s = 3600;
  Certificate made(X509_new());
  X509* const x = made.get();
  X509* const by = issuer == nullptr ? x : issuer;
  bool good = X509_set_version(x, X509_VERSION_3) == 1 && give_serial(x) &&
              X509_gmtime_adj(X509_getm_notBefore(x), -kSlowClocks_s) != nullptr &&
              X509_time_adj_ex(X509_getm_notAfter(x), days, 0, nullptr) != nullptr &&
              X509_set_pubkey(x, &key) == 1 && X509_set_subject_name(x, &subject) == 1 &&
              X509_set_issuer_name(x, X509_get_subject_name(by)) == 1 &&
              extend(x, by, NID_subject_key_identifier, "hash");
  if (issuer == nullptr) {
    good = good && extend(x, by, NID_basic_constraints, "critical,CA:TRUE,pathlen:0") &&
           extend(x, by, NID_key_usage, "critical,keyCertSign,cRLSign");
  } else {
    // Distinguishes two authorities with the same name while a lab replaces one with the other.
    good = good &&
           (X509_get0_subject_key_id(by) == nullptr ||
            extend(x, by, NID_authority_key_identifier, "keyid:always")) &&
           extend(x, by, NID_basic_constraints, "critical,CA:FALSE") &&
           extend(x, by, NID_key_usage, "critical,digitalSignature") &&
           extend(x, by, NID_ext_key_usage, "serverAuth,clientAuth") && X509_add_ext(x, names, -1) == 1;
  }
  good = good && X509_sign(x, &signer, EVP_sha256()) > 0;
  return good ? std::move(made) : nullptr;
}

Extension names_of(const CertificateRequest& request) {
  std::string names;
  for (const std::string& host : request.hosts)
    names += fmt::format("{}:{},", is_ip_address(host) ? "IP" : "DNS", host);
  for (const std::string& role : request.roles) names += fmt::format("URI:{}{},", kRoleUri, role);
  names.pop_back();
  return Extension(X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, names.c_str()));
}

std::string address_of(const ASN1_OCTET_STRING& octets) {
  char text[INET6_ADDRSTRLEN] = "";
  ::inet_ntop(ASN1_STRING_length(&octets) == 4 ? AF_INET : AF_INET6, ASN1_STRING_get0_data(&octets), text,
              sizeof text);
  return text;
}

IssuedCertificate described(const std::string& name, const X509& certificate) {
  IssuedCertificate issued{{name, {}, {}}, end_of(certificate)};
  const AltNames names = alt_names_of(certificate);
  for (int i = 0; i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME& each = *sk_GENERAL_NAME_value(names.get(), i);
    if (each.type == GEN_DNS) issued.of.hosts.emplace_back(text_of(*each.d.dNSName));
    if (each.type == GEN_IPADD) issued.of.hosts.push_back(address_of(*each.d.iPAddress));
    if (each.type != GEN_URI) continue;
    const std::string_view uri = text_of(*each.d.uniformResourceIdentifier);
    if (uri.starts_with(kRoleUri)) issued.of.roles.emplace_back(uri.substr(kRoleUri.size()));
  }
  return issued;
}

// Writes both files under temporary names, then renames them, so that they replace the old ones atomically,
// except between the two renames.
absl::Status write_pair(const fs::path& certificate, const fs::path& key, const X509& x, const EVP_PKEY& k) {
  const fs::path new_certificate = certificate.string() + ".new", new_key = key.string() + ".new";
  GW_RETURN_IF_ERROR(write_secret_flushed(new_key, pem_of(k)));
  GW_RETURN_IF_ERROR(write_file_flushed(new_certificate, pem_of(x)));
  GW_RETURN_IF_ERROR(rename_file(new_key, key));
  GW_RETURN_IF_ERROR(rename_file(new_certificate, certificate));
  return flush_directory(key.has_parent_path() ? key.parent_path() : ".");
}

absl::StatusOr<Certificate> read_certificate(const fs::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string pem, read_file(path));
  std::vector<Certificate> certificates = certificates_in(pem);
  if (!certificates.empty()) return std::move(certificates.front());
  return absl::InvalidArgumentError(fmt::format("{} is not a certificate in PEM", path.string()));
}

}  // namespace

absl::StatusOr<CertificateAuthority> CertificateAuthority::init(const fs::path& directory,
                                                                const std::string& name) {
  constexpr size_t kMaxName = 64;  // RFC 5280, ub-common-name
  if (name.empty() || name.size() > kMaxName) {
    return absl::InvalidArgumentError(
        fmt::format("--name is \"{}\"; it must have 1 to {} bytes", name, kMaxName));
  }
  GW_RETURN_IF_ERROR(make_directory(directory));
  GW_ASSIGN_OR_RETURN(auto lock, lock_directory(directory));
  CertificateAuthority authority(directory, std::move(lock));
  GW_RETURN_IF_ERROR(authority.check_free(kAuthority));
  const PrivateKey key(EVP_EC_gen("P-256"));
  if (key == nullptr) return openssl_error("a key");
  authority.certificate_ = made_certificate(*name_of(name), *key, kMaxDays, nullptr, *key, nullptr);
  if (authority.certificate_ == nullptr) return openssl_error("the authority's certificate");
  GW_RETURN_IF_ERROR(write_pair(authority.file(kAuthority, ".pem"), authority.file(kAuthority, ".key"),
                                *authority.certificate_, *key));
  return authority;
}

absl::StatusOr<CertificateAuthority> CertificateAuthority::open(const fs::path& directory) {
  const auto none = [&] {
    return absl::NotFoundError(fmt::format("{} has no authority, ca.pem; glasswing pki init {} makes one",
                                           directory.string(), directory.string()));
  };
  auto lock = lock_directory(directory);
  if (absl::IsNotFound(lock.status())) return none();
  GW_RETURN_IF_ERROR(lock.status());
  CertificateAuthority authority(directory, *std::move(lock));
  auto certificate = read_certificate(authority.file(kAuthority, ".pem"));
  if (absl::IsNotFound(certificate.status())) return none();
  GW_RETURN_IF_ERROR(certificate.status());
  authority.certificate_ = *std::move(certificate);
  return authority;
}

absl::Status CertificateAuthority::check_free(const std::string& name) const {
  const fs::path certificate = file(name, ".pem"), key = file(name, ".key");
  std::error_code ignored;
  if (fs::exists(certificate, ignored)) {
    return absl::AlreadyExistsError(
        name == kAuthority ? fmt::format("{} already exists; another authority needs another directory",
                                         certificate.string())
                           : fmt::format("{} already exists; glasswing pki renew {} {} replaces it",
                                         certificate.string(), directory_.string(), name));
  }
  if (!fs::exists(key, ignored)) return absl::OkStatus();
  return absl::AlreadyExistsError(fmt::format("{} exists without {}; put that back, or remove the key",
                                              key.string(), certificate.filename().string()));
}

absl::StatusOr<IssuedCertificate> CertificateAuthority::sign(const std::string& name,
                                                             const X509_NAME& subject, X509_EXTENSION& names,
                                                             int days) const {
  using std::chrono::floor;
  const auto left =
      floor<std::chrono::days>(valid_until() - floor<std::chrono::seconds>(std::chrono::system_clock::now()));
  if (left.count() < days) {
    return absl::InvalidArgumentError(
        left.count() < 1 ? fmt::format("the authority {} has expired; the lab needs a new one",
                                       file(kAuthority, ".pem").string())
                         : fmt::format("--days is {}; the authority {} is valid for {} more", days,
                                       file(kAuthority, ".pem").string(), left.count()));
  }
  const fs::path signer_path = file(kAuthority, ".key");
  GW_ASSIGN_OR_RETURN(const std::string signer_pem, read_file(signer_path));
  const PrivateKey signer = private_key_in(signer_pem);
  if (signer == nullptr || X509_check_private_key(certificate_.get(), signer.get()) != 1) {
    return absl::InvalidArgumentError(fmt::format("{} is not the key of {}", signer_path.string(),
                                                  file(kAuthority, ".pem").filename().string()));
  }
  const PrivateKey key(EVP_EC_gen("P-256"));
  if (key == nullptr) return openssl_error("a key");
  const Certificate made = made_certificate(subject, *key, days, certificate_.get(), *signer, &names);
  if (made == nullptr) return openssl_error("a certificate");
  GW_RETURN_IF_ERROR(write_pair(file(name, ".pem"), file(name, ".key"), *made, *key));
  return described(name, *made);
}

absl::StatusOr<IssuedCertificate> CertificateAuthority::issue(const CertificateRequest& request,
                                                              int days) const {
  GW_RETURN_IF_ERROR(check_free(request.name));
  const Extension names = names_of(request);
  if (names == nullptr) return openssl_error("the certificate's names");
  return sign(request.name, *name_of(request.name), *names, days);
}

absl::StatusOr<Certificate> CertificateAuthority::find(const std::string& name) const {
  GW_ASSIGN_OR_RETURN(Certificate certificate, read_certificate(file(name, ".pem")));
  const bool ours = X509_NAME_cmp(X509_get_issuer_name(certificate.get()),
                                  X509_get_subject_name(certificate_.get())) == 0 &&
                    X509_verify(certificate.get(), X509_get0_pubkey(certificate_.get())) == 1;
  ERR_clear_error();
  return ours ? std::move(certificate) : nullptr;
}

absl::StatusOr<IssuedCertificate> CertificateAuthority::renew(const std::string& name, int days) const {
  GW_RETURN_IF_ERROR(check_certificate_name(name));
  const absl::StatusOr<Certificate> old = find(name);
  if (absl::IsNotFound(old.status())) {
    return absl::NotFoundError(fmt::format("there is no {}; glasswing pki issue {} ROLE:{} makes it",
                                           file(name, ".pem").string(), directory_.string(), name));
  }
  GW_RETURN_IF_ERROR(old.status());
  if (*old == nullptr) {
    return absl::NotFoundError(
        fmt::format("{} was not signed by the authority beside it", file(name, ".pem").string()));
  }
  const int at = X509_get_ext_by_NID(old->get(), NID_subject_alt_name, -1);
  if (at < 0)
    return absl::InvalidArgumentError(fmt::format("{} has no roles and hosts", file(name, ".pem").string()));
  return sign(name, *X509_get_subject_name(old->get()), *X509_get_ext(old->get(), at), days);
}

absl::StatusOr<std::vector<IssuedCertificate>> CertificateAuthority::issued() const {
  std::vector<IssuedCertificate> all;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_, error)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() != ".pem" || name == kAuthority) continue;
    GW_ASSIGN_OR_RETURN(const Certificate certificate, find(name));
    if (certificate != nullptr) all.push_back(described(name, *certificate));
  }
  if (error)
    return absl::InternalError(fmt::format("cannot read {}: {}", directory_.string(), error.message()));
  std::ranges::sort(all, {}, [](const IssuedCertificate& each) { return each.of.name; });
  return all;
}

std::string CertificateAuthority::name() const {
  char text[256] = "";
  X509_NAME_get_text_by_NID(X509_get_subject_name(certificate_.get()), NID_commonName, text, sizeof text);
  return text;
}

}  // namespace glasswing
